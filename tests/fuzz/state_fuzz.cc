// JSON that another process wrote: the live state of a running program, the state file of a
// testbed, and a request to its holder. The first byte says which; the rest is the text.
#include <algorithm>
#include <string>

#include "app/watch/json.h"
#include "netns/state/control.h"
#include "netns/state/error.h"
#include "netns/state/state_file.h"
#include "tests/fuzz/finding.h"
#include "tests/fuzz/input.h"
#include "tests/fuzz/scratch_folder.h"

namespace {

using namespace interneuron;
using fuzz::require;

bool is_printable(const std::string& text) {
  return std::ranges::none_of(text, [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte < 0x20 || byte == 0x7f;
  });
}

void try_live(const std::string& text) {
  const auto live = watch::live_from_json(text);
  if (!live) return;
  require(is_printable(live->program), "a program's name is not printable");
  for (const auto& link : live->links) {
    require(is_printable(link.nic) && is_printable(link.measured.path_reason),
            "the text of a link is not printable");
  }
  for (const watch::LinkEvent& event : live->events) {
    require(is_printable(event.nic) && is_printable(event.reason), "an event is not printable");
  }
  // Text that is no UTF-8 cannot be written, and JSON that was parsed holds none.
  const auto again = watch::live_from_json(watch::live_json(*live).dump());
  require(again && again->links.size() == live->links.size() &&
              again->events.size() == live->events.size(),
          "a live state cannot be read again");
}

void try_state(std::string_view text) {
  static const fuzz::ScratchFolder folder;
  const auto file = folder.write("default.json", text);
  try {
    const auto state = netns::read_state(file);
    require(state.has_value(), "a state file is not there");
    require(state->holder > 0 && state->vehicle_count() > 0 && !state->road_ns_fds.empty(),
            "a state lacks what it must have");
    netns::write_state(*state);
    const auto again = netns::read_state(file);
    require(again && again->holder == state->holder && again->links.size() == state->links.size() &&
                again->control_token == state->control_token,
            "a state has changed by being written and read");
  } catch (const netns::TestbedError& error) {
    require(error.exit_code == 1, "a bad state file has another exit code");
  }
}

void try_request(std::string_view text) {
  constexpr const char* kToken = "0123456789abcdef0123456789abcdef";
  if (const auto request = netns::parse_request(text, kToken)) {
    require(
        text.find(kToken) != std::string_view::npos || text.find('\\') != std::string_view::npos,
        "a request without the token is carried out");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input({data, size});
  // Letters, so that seeds are files that people can read.
  switch (input.take<char>()) {
    case 'l':
      try_live(std::string(input.text()));
      break;
    case 's':
      try_state(input.text());
      break;
    case 'r':
      try_request(input.text());
      break;
    default:
      break;
  }
  return 0;
}
