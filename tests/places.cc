#include "tests/places.h"

namespace interneuron::places {

const std::string& source() {
  static const std::string path = INTERNEURON_SOURCE_DIR;
  return path;
}

const std::string& build() {
  static const std::string path = INTERNEURON_BINARY_DIR;
  return path;
}

const std::string& program() {
  static const std::string path = INTERNEURON_PROGRAM_FILE;
  return path;
}

const std::string& nature() {
  static const std::string path = INTERNEURON_NATURE_FILE;
  return path;
}

}  // namespace interneuron::places
