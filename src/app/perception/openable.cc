#include "app/perception/openable.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

namespace interneuron::perception {

void check_openable(const std::string& what, const std::filesystem::path& file) {
  errno = 0;
  const std::ifstream in(file);
  const int error = errno;
  if (in || (error != EMFILE && error != ENFILE && error != ENOMEM)) return;
  const char* remedy = error == ENOMEM ? "; free some" : "; raise the limit with `ulimit -n`";
  throw std::runtime_error(what + " '" + file.string() + "': " + std::strerror(error) + remedy);
}

}  // namespace interneuron::perception
