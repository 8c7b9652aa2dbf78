// The one exception of this folder: something the user named (a video, a folder, a camera, a model,
// a recording) cannot be used. what() is one line that names the thing and the remedy, ready to be
// printed.
#pragma once

#include <stdexcept>

namespace interneuron::perception {

class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace interneuron::perception
