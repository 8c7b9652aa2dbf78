// A message as it travels: the header that it begins with, and the application's bytes. Kept apart,
// so that neither side copies a payload to put a header before it or to take one off.
//
// Owns both. A plain value; pure; thread-compatible.
#pragma once

#include <algorithm>
#include <utility>

#include "core/wire/packet.h"
#include "core/wire/plain_header.h"
#include "core/wire/round_header.h"
#include "interneuron/few.h"
#include "interneuron/units.h"

namespace interneuron::wire {

// How many bytes of a message of this kind are its header, at least: where it is that of a plain
// one, these bytes tell (plain_header_bytes()).
constexpr std::size_t header_bytes(MessageKind kind) {
  if (kind == MessageKind::kRevocations) return 0;
  return kind == MessageKind::kPlain ? kPlainHeaderBytes : kRoundHeaderBytes;
}
// The same of the message that begins with these bytes, of which there are so many at least.
inline std::size_t header_bytes(MessageKind kind, ByteView begin) {
  if (kind != MessageKind::kPlain || begin.size() < kPlainHeaderBytes) return header_bytes(kind);
  return plain_header_bytes(begin.first<kPlainHeaderBytes>());
}

struct MessageBytes {
  static constexpr std::size_t kMostHeaderBytes =
      std::max(kMostPlainHeaderBytes, kRoundHeaderBytes);
  using Header = Few<std::byte, kMostHeaderBytes>;

  Header header;
  Bytes payload;

  MessageBytes() = default;
  // A message without a header.
  MessageBytes(Bytes bytes) : payload(std::move(bytes)) {}
  MessageBytes(ByteView head, Bytes bytes) : payload(std::move(bytes)) {
    for (const std::byte b : head) header.push_back(b);
  }

  std::size_t size() const { return header.size() + payload.size(); }
  bool empty() const { return size() == 0; }
  ByteView header_view() const { return {header.data(), header.size()}; }

  // The `size` bytes from `offset` on, which are there: those in the header and those behind it.
  struct Part {
    ByteView header;
    ByteView payload;
    std::size_t size() const { return header.size() + payload.size(); }
  };
  Part part(std::size_t offset, std::size_t size) const {
    const std::size_t begin = std::min(offset, header.size());
    const std::size_t end = std::min(offset + size, header.size());
    return {header_view().subspan(begin, end - begin),
            ByteView(payload).subspan(std::max(offset, header.size()) - header.size(),
                                      size - (end - begin))};
  }
};

}  // namespace interneuron::wire
