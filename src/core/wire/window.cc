#include "core/wire/window.h"

namespace interneuron::wire {

void put_window(Writer& w, const WindowHeader& h) {
  w.put(h.row);
  w.put(static_cast<std::uint8_t>(h.messages.size()));
  std::uint32_t before = 0;
  bool is_first = true;
  for (const auto& [message, pieces] : h.messages) {
    if (is_first) {
      w.put(message.value);
    } else {
      w.put(static_cast<std::uint8_t>(message.value - before));
    }
    is_first = false;
    before = message.value;
    w.put(pieces);
  }
}

std::optional<Window> get_window(Reader& r) {
  Window out;
  WindowHeader& h = out.header;
  h.row = r.get<std::uint8_t>();
  const auto count = r.get<std::uint8_t>();
  if (h.row >= code::kMostRows || count == 0 || count > kMostWindowMessages) return std::nullopt;
  std::uint32_t message = 0;
  for (std::uint8_t i = 0; i < count; ++i) {
    const std::uint32_t ahead = i == 0 ? r.get<std::uint32_t>() : r.get<std::uint8_t>();
    if (i > 0 && ahead == 0) return std::nullopt;
    message += ahead;
    const auto pieces = r.get<std::uint8_t>();
    if (pieces == 0) return std::nullopt;
    h.messages.push_back({MessageId{message}, pieces});
  }
  out.bytes = r.rest();
  const bool fits = out.bytes.size() > kSourceHeaderBytes &&
                    out.bytes.size() <= kSourceHeaderBytes + code::kMostBytes;
  if (!r.ok() || !fits || h.sources() > code::kMostSources) return std::nullopt;
  return out;
}

}  // namespace interneuron::wire
