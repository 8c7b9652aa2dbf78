#include "app/offload/offload_request.h"

#include <algorithm>

#include "core/wire/bytes.h"

namespace interneuron::offload {
namespace {

constexpr std::uint16_t kMagic = 0x4F46;
constexpr std::uint8_t kVersion = 1;

}  // namespace

Bytes with_request(Duration budget, ByteView image) {
  Bytes out(kRequestBytes + image.size());
  wire::Writer w(out);
  w.put(kMagic);
  w.put(kVersion);
  w.put(std::uint8_t{0});
  w.put(static_cast<std::uint32_t>(std::clamp<std::int64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(budget).count(), 0, UINT32_MAX)));
  w.put_bytes(image);
  return out;
}

std::optional<std::pair<Duration, ByteView>> parse_request(ByteView bytes) {
  wire::Reader r(bytes);
  const auto magic = r.get<std::uint16_t>();
  const auto version = r.get<std::uint8_t>();
  const auto reserved = r.get<std::uint8_t>();
  const auto budget = r.get<std::uint32_t>();
  if (!r.ok() || magic != kMagic || version != kVersion || reserved != 0) return std::nullopt;
  return std::pair<Duration, ByteView>{std::chrono::microseconds(budget), r.rest()};
}

}  // namespace interneuron::offload
