// Reads and writes state files: RUNTIME_DIR/NAME.json, one per testbed that is up.
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
// Another program may have written a file of that name, so every field is checked; above all the
// process number, to which down() sends signals. Errors: TestbedError (1). Processes exclude each
// other by RuntimeDirLock; within a process these functions are not thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "netns/state/state.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

// Throws unless `name` has 1 to `max` characters of [A-Za-z0-9_-]; the error begins with `what`,
// which is what the name is for.
void check_name(const std::string& name, std::size_t max, const std::string& what);

// RUNTIME_DIR/NAME.json. Throws for a bad name.
std::filesystem::path state_path(const std::filesystem::path& runtime_dir, const std::string& name);

// Makes the directory with mode 0700 unless it is there; RuntimeDirLock looks at what is there.
void make_runtime_dir(const std::filesystem::path& runtime_dir);

// Excludes other processes from the state files of a directory while it lives. The constructor
// waits for them. Every use of a directory begins here, and so does the judgement of it: the
// constructor throws, before it waits, when the directory cannot be opened, is a symbolic link,
// belongs to another user or can be entered by one. Such a user could write state files by which we
// end any of our processes, or hold the lock for ever.
class RuntimeDirLock {
 public:
  explicit RuntimeDirLock(const std::filesystem::path& runtime_dir);

 private:
  io::FileDescriptor directory_;
};

// Replaces the file in one step, so that a reader sees the old one or the new one. Only its owner
// and root can read it.
void write_state(const State& state);

// Empty when there is no such file. Throws when it is no state file of this version.
std::optional<State> read_state(const std::filesystem::path& file);

// Field 22 of /proc/PID/stat, in clock ticks since boot; empty when there is no such process or it
// is a zombie.
std::optional<std::uint64_t> start_ticks(pid_t pid);

// Whether the holder that wrote this state still runs.
bool holder_alive(const State& state);

}  // namespace interneuron::netns
