#include "netns/state/state_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "netns/state/check.h"
#include "netns/state/json.h"

namespace interneuron::netns {

namespace {

constexpr int kSchema = 2;

Json to_json(const TestbedLink& link) {
  return {{"name", link.name},
          {"vehicle", link.vehicle},
          {"profile", link.profile},
          {"nic", link.nic},
          {"vehicle_address", link.vehicle_address},
          {"gateway", link.gateway},
          {"road_address", link.road_address},
          {"vehicle_address6", link.vehicle_address6},
          {"gateway6", link.gateway6},
          {"road_address6", link.road_address6}};
}

Json to_json(const State& state) {
  Json links = Json::array();
  for (const TestbedLink& link : state.links) links.push_back(to_json(link));
  return {{"schema", kSchema},
          {"name", state.name},
          {"pid", state.holder},
          {"pid_start_ticks", state.holder_start_ticks},
          {"detached", state.detached},
          {"seed", state.seed},
          {"backend", backend_name(state.backend)},
          {"nat", state.nat},
          {"control", {{"socket", state.control}, {"token", state.control_token}}},
          {"fds",
           {{"user_namespace", state.user_ns_fd},
            {"vehicle_namespaces", state.vehicle_ns_fds},
            {"road_namespaces", state.road_ns_fds},
            {"core_namespace", state.core_ns_fd},
            {"stats", state.stats_fd}}},
          {"links", std::move(links)}};
}

std::string text_of(const Json& object, const char* key) {
  return object.at(key).get<std::string>();
}

template <class Number>
Number number_of(const Json& object, const char* key) {
  return integer<Number>(object.at(key));
}

std::vector<int> numbers_of(const Json& object, const char* key) {
  std::vector<int> numbers;
  for (const Json& number : array(object.at(key))) numbers.push_back(integer<int>(number));
  if (numbers.empty()) throw std::runtime_error(std::string("no ") + key);
  return numbers;
}

TestbedLink link_from_json(const Json& link) {
  TestbedLink out;
  out.name = text_of(link, "name");
  out.vehicle = number_of<std::size_t>(link, "vehicle");
  out.profile = text_of(link, "profile");
  out.nic = text_of(link, "nic");
  out.vehicle_address = text_of(link, "vehicle_address");
  out.gateway = text_of(link, "gateway");
  out.road_address = text_of(link, "road_address");
  out.vehicle_address6 = text_of(link, "vehicle_address6");
  out.gateway6 = text_of(link, "gateway6");
  out.road_address6 = text_of(link, "road_address6");
  return out;
}

Backend backend_from(const std::string& name) {
  for (const Backend backend : {Backend::kNetem, Backend::kEmulator}) {
    if (name == backend_name(backend)) return backend;
  }
  throw std::runtime_error("no back end '" + name + "'");
}

// Throws std::exception when anything is missing or of the wrong type.
State from_json(const Json& object, const std::filesystem::path& file) {
  if (number_of<int>(object, "schema") != kSchema) throw std::runtime_error("another schema");
  State state;
  state.name = text_of(object, "name");
  state.holder = number_of<pid_t>(object, "pid");
  // kill(2) takes 0 and negative numbers for whole groups of processes.
  if (state.holder <= 0) throw std::runtime_error("no process");
  state.holder_start_ticks = number_of<std::uint64_t>(object, "pid_start_ticks");
  state.detached = object.at("detached").get<bool>();
  state.seed = number_of<std::uint64_t>(object, "seed");
  state.backend = backend_from(text_of(object, "backend"));
  state.nat = object.at("nat").get<bool>();
  const Json& control = object.at("control");
  state.control = text_of(control, "socket");
  state.control_token = text_of(control, "token");
  const Json& fds = object.at("fds");
  state.user_ns_fd = number_of<int>(fds, "user_namespace");
  state.vehicle_ns_fds = numbers_of(fds, "vehicle_namespaces");
  state.road_ns_fds = numbers_of(fds, "road_namespaces");
  state.core_ns_fd = number_of<int>(fds, "core_namespace");
  state.stats_fd = number_of<int>(fds, "stats");
  for (const Json& link : array(object.at("links"))) state.links.push_back(link_from_json(link));
  state.file = file;
  return state;
}

[[noreturn]] void refuse(const std::filesystem::path& runtime_dir, const std::string& what) {
  throw TestbedError(1, "'" + runtime_dir.string() + "' is not a directory of yours but " + what +
                            "; remove it, or set XDG_RUNTIME_DIR to a folder of yours");
}

}  // namespace

void check_name(const std::string& name, std::size_t max, const std::string& what) {
  const bool fine =
      !name.empty() && name.size() <= max && std::all_of(name.begin(), name.end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
               c == '_' || c == '-';
      });
  if (fine) return;
  throw TestbedError(2, what + " '" + name + "' must have 1 to " + std::to_string(max) +
                            " characters of A-Z a-z 0-9 _ -");
}

std::filesystem::path state_path(const std::filesystem::path& runtime_dir,
                                 const std::string& name) {
  check_name(name, 64, "the name of a testbed");
  return runtime_dir / (name + ".json");
}

void make_runtime_dir(const std::filesystem::path& runtime_dir) {
  // If this fails, mkdir() below fails as well and reports it.
  std::error_code ignored;
  std::filesystem::create_directories(runtime_dir.parent_path(), ignored);
  if (::mkdir(runtime_dir.c_str(), 0700) != 0 && errno != EEXIST) {
    fail_errno("make the directory " + runtime_dir.string());
  }
}

RuntimeDirLock::RuntimeDirLock(const std::filesystem::path& runtime_dir)
    : directory_(::open(runtime_dir.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC)) {
  // A symbolic link is ENOTDIR here, with some kernels ELOOP.
  if (directory_.get() < 0 && (errno == ENOTDIR || errno == ELOOP)) {
    refuse(runtime_dir, "no directory, or a symbolic link");
  }
  check(directory_.get(), "open the directory " + runtime_dir.string());
  struct stat status {};
  check(::fstat(directory_.get(), &status), "look at the directory " + runtime_dir.string());
  if (status.st_uid != ::geteuid()) {
    refuse(runtime_dir, "of user " + std::to_string(status.st_uid));
  }
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
    throw TestbedError(1, "'" + runtime_dir.string() +
                              "' is open to other users; `chmod 700` it if nobody else uses it");
  }
  check(::flock(directory_.get(), LOCK_EX), "lock the directory " + runtime_dir.string());
}

void write_state(const State& state) {
  const std::string temporary = state.file.string() + ".new";
  const std::string text = to_json(state).dump() + '\n';
  // Mode 0600: whoever can read the token can change the links.
  ::unlink(temporary.c_str());
  const io::FileDescriptor out(
      ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (out.get() < 0) fail_errno("write " + state.file.string());
  const ssize_t written = ::write(out.get(), text.data(), text.size());
  // A disk that is nearly full takes a part.
  int error = written < 0 ? errno : 0;
  if (error == 0 && written != static_cast<ssize_t>(text.size())) error = ENOSPC;
  if (error == 0 && ::rename(temporary.c_str(), state.file.c_str()) != 0) error = errno;
  if (error == 0) return;
  ::unlink(temporary.c_str());
  fail_errno("write " + state.file.string(), error);
}

std::optional<State> read_state(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) {
    if (errno == ENOENT) return std::nullopt;
    fail_errno("read " + file.string());
  }
  try {
    std::stringstream text;
    text << in.rdbuf();
    return from_json(Json::parse(text.str()), file);
  } catch (const std::exception& error) {
    throw TestbedError(1, file.string() + " is no state file of this program's version (" +
                              error.what() + "); end its testbed with that version, or remove it");
  }
}

std::optional<std::uint64_t> start_ticks(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string line;
  if (!std::getline(file, line)) return std::nullopt;
  // The second field is the program's name in parentheses and may itself contain spaces and
  // parentheses.
  const std::size_t name_end = line.rfind(')');
  if (name_end == std::string::npos) return std::nullopt;
  std::istringstream fields(line.substr(name_end + 1));
  std::string field;
  // Field 3 is the state of the process.
  fields >> field;
  if (!fields || field == "Z" || field == "X") return std::nullopt;
  constexpr int kSkipped = 22 - 4;
  for (int i = 0; i < kSkipped; ++i) fields >> field;
  std::uint64_t ticks = 0;
  fields >> ticks;
  return fields ? std::optional(ticks) : std::nullopt;
}

bool holder_alive(const State& state) {
  return start_ticks(state.holder) == state.holder_start_ticks;
}

}  // namespace interneuron::netns
