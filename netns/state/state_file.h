// Where a testbed is written down: RUNTIME_DIR/NAME.json, one file per testbed that is up, readable
// with any JSON tool.
//
//   {"schema": 2, "name": "default", "pid": 4711, "pid_start_ticks": 12345, "detached": true,
//    "seed": 1, "backend": "netem", "nat": false,
//    "control": {"socket": "interneuron-4711", "token": "6f1c..."},
//    "fds": {"user_namespace": -1, "vehicle_namespaces": [5], "road_namespaces": [6],
//            "core_namespace": 7, "stats": 9},
//    "links": [{"name": "5g", "vehicle": 0, "profile": "5g", "nic": "if5g",
//               "vehicle_address": "10.77.1.2", "gateway": "10.77.1.1",
//               "road_address": "10.77.0.1", "vehicle_address6": "fd77:0:1:1::2",
//               "gateway6": "fd77:0:1:1::1", "road_address6": "fd77:0:1::1"}]}
//
// Errors: TestbedError (1). Thread-safety: between processes by RuntimeDirLock; within one none.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "host/io/file_descriptor.h"
#include "netns/state/state.h"

namespace interneuron::netns {

// Throws unless `name` has 1..max characters of [A-Za-z0-9_-]; `what` says what it names.
void check_name(const std::string& name, std::size_t max, const std::string& what);

// RUNTIME_DIR/NAME.json
std::filesystem::path state_path(const std::filesystem::path& runtime_dir, const std::string& name);

// Makes the directory (mode 0700). One of somebody else is refused: whoever owns it could have us
// end any process.
void make_runtime_dir(const std::filesystem::path& runtime_dir);

// Excludes other processes from the state files of a directory while it lives.
class RuntimeDirLock {
 public:
  explicit RuntimeDirLock(const std::filesystem::path& runtime_dir);

 private:
  io::FileDescriptor directory_;
};

// All at once: a reader sees the old file or the new one. Readable by its owner (and root) only.
void write_state(const State& state);

// Empty without the file. Throws when it is not ours to understand.
std::optional<State> read_state(const std::filesystem::path& file);

// Field 22 of /proc/PID/stat, in clock ticks since boot; empty when there is no such process or it
// is a zombie.
std::optional<std::uint64_t> start_ticks(pid_t pid);

bool holder_alive(const State& state);

}  // namespace interneuron::netns
