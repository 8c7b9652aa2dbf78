#include "core/wire/source.h"

#include <algorithm>

#include "core/wire/bytes.h"

namespace interneuron::wire {

SourceHeader source_header(const FragmentHeader& f) {
  SourceHeader out{};
  Writer w(out);
  w.put(f.size);
  w.put(f.chunk);
  w.put(f.lifetime_us);
  w.put(static_cast<std::uint8_t>(f.kind));
  return out;
}

std::optional<Data> get_source(MessageId message, std::uint8_t index, ByteView source) {
  Reader r(source);
  Data d;
  FragmentHeader& f = d.fragment;
  f.message = message;
  f.index = index;
  f.size = r.get<std::uint32_t>();
  f.chunk = r.get<std::uint16_t>();
  f.lifetime_us = r.get<std::uint32_t>();
  const auto kind = r.get<std::uint8_t>();
  const bool is_valid = r.ok() && f.size > 0 && f.chunk > 0 &&
                        f.size <= std::uint64_t{f.chunk} * kMostWindowPieces &&
                        kind <= static_cast<std::uint8_t>(kLastKind);
  if (!is_valid) return std::nullopt;
  f.kind = static_cast<MessageKind>(kind);
  const ByteView rest = r.rest();
  if (f.is_repair() || f.bytes() > rest.size()) return std::nullopt;
  const auto is_zero = [](std::byte b) { return b == std::byte{0}; };
  if (!std::ranges::all_of(rest.subspan(f.bytes()), is_zero)) return std::nullopt;
  d.bytes = rest.first(f.bytes());
  return d;
}

}  // namespace interneuron::wire
