// Where the tests find the source tree, the build and its programs. These absolute paths are
// compiled into one object alone (places.cc), so that every other object of the tests is the same
// in any clone and a compiler cache may serve it.
#pragma once

#include <string>

namespace interneuron::places {

const std::string& source();
const std::string& build();
// The programs; empty where they are not built.
const std::string& program();
const std::string& nature();

}  // namespace interneuron::places
