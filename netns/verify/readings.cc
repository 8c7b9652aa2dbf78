#include "netns/verify/readings.h"

#include <charconv>
#include <cstring>
#include <unordered_set>

namespace interneuron::netns::verify {

namespace {

constexpr std::size_t kFileHeader = 24;
constexpr std::size_t kRecordHeader = 16;
// The first four bytes of a capture, in the byte order of the host that wrote it; the magic number
// tells whether times have microseconds or nanoseconds (pcap-savefile(5)).
constexpr std::uint32_t kMagicMicro = 0xa1b2c3d4;
constexpr std::uint32_t kMagicNano = 0xa1b23c4d;
// LINKTYPE_ETHERNET.
constexpr std::uint32_t kEthernet = 1;
constexpr std::size_t kEthernetHeader = 14;
constexpr std::size_t kUdpHeader = 8;
constexpr std::size_t kIperfHeader = 12;
constexpr unsigned kUdp = 17;
// What ping may print, so that no arithmetic with it overflows: the wall clock as 32 bits hold it,
// and a day, which no answer takes.
constexpr std::int64_t kLastSecond = UINT32_MAX;
constexpr double kLongestMs = 86'400'000;

// The value after `key`, up to a space; empty when there is none.
std::string_view word_after(std::string_view line, std::string_view key) {
  const std::size_t at = line.find(key);
  if (at == std::string_view::npos) return {};
  const std::string_view rest = line.substr(at + key.size());
  return rest.substr(0, rest.find_first_of(" \n"));
}

template <class Number>
std::optional<Number> number(std::string_view text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// "1795276741.316347", kept whole: a double would lose the microseconds.
std::optional<Duration> wall_clock(std::string_view text) {
  const std::size_t point = text.find('.');
  if (point == std::string_view::npos || text.size() - point != 7) return std::nullopt;
  const auto seconds = number<std::int64_t>(text.substr(0, point));
  const auto micros = number<std::int64_t>(text.substr(point + 1));
  if (!seconds || !micros || *seconds < 0 || *seconds > kLastSecond || *micros < 0) {
    return std::nullopt;
  }
  return std::chrono::seconds(*seconds) + std::chrono::microseconds(*micros);
}

std::optional<Ping> parse_answer(std::string_view line) {
  if (!line.starts_with('[') || line.find("(DUP!)") != std::string_view::npos) return std::nullopt;
  const auto printed = wall_clock(line.substr(1, line.find(']') - 1));
  const auto sequence = number<std::uint32_t>(word_after(line, "icmp_seq="));
  const auto rtt_ms = number<double>(word_after(line, " time="));
  if (!printed || !sequence || !rtt_ms || !(*rtt_ms >= 0 && *rtt_ms <= kLongestMs)) {
    return std::nullopt;
  }
  const Duration rtt = from_ms(*rtt_ms);
  return Ping{*sequence, *printed - rtt, rtt};
}

std::uint32_t host_order(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

std::uint32_t network_order(std::string_view bytes, std::size_t at, std::size_t count) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < count; ++i) {
    value = value << 8U | static_cast<unsigned char>(bytes[at + i]);
  }
  return value;
}

std::optional<Datagram> parse_frame(std::string_view frame) {
  if (frame.size() < kEthernetHeader + 20 || network_order(frame, 12, 2) != 0x0800) {
    return std::nullopt;
  }
  const std::string_view ip = frame.substr(kEthernetHeader);
  const std::size_t ip_header = (network_order(ip, 0, 1) & 0xfU) * 4;
  const std::size_t payload = ip_header + kUdpHeader;
  if (network_order(ip, 9, 1) != kUdp || ip.size() < payload + kIperfHeader) return std::nullopt;
  Datagram out{.ip_bytes = network_order(ip, 2, 2)};
  // What is captured beyond the IP length is padding of a short Ethernet frame, not payload.
  if (out.ip_bytes < payload + kIperfHeader) return std::nullopt;
  out.from_port = static_cast<std::uint16_t>(network_order(ip, ip_header, 2));
  out.to_port = static_cast<std::uint16_t>(network_order(ip, ip_header + 2, 2));
  out.stamp = std::chrono::seconds(network_order(ip, payload, 4)) +
              std::chrono::microseconds(network_order(ip, payload + 4, 4));
  out.number = network_order(ip, payload + 8, 4);
  return out;
}

}  // namespace

PingLog parse_ping(std::string_view text) {
  PingLog log;
  std::unordered_set<std::uint32_t> known;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (const auto ping = parse_answer(line)) {
      if (known.insert(ping->sequence).second) log.answered.push_back(*ping);
    } else if (const std::size_t at = line.find(" packets transmitted");
               at != std::string_view::npos) {
      log.transmitted = number<std::size_t>(line.substr(0, at)).value_or(0);
    }
  }
  return log;
}

std::optional<std::vector<Datagram>> parse_capture(std::string_view bytes) {
  if (bytes.size() < kFileHeader) return std::nullopt;
  const std::uint32_t magic = host_order(bytes, 0);
  if (magic != kMagicMicro && magic != kMagicNano) return std::nullopt;
  if ((host_order(bytes, 20) & 0xffffU) != kEthernet) return std::nullopt;
  const std::int64_t fraction_ns = magic == kMagicNano ? 1 : 1000;
  std::vector<Datagram> out;
  for (std::size_t at = kFileHeader; at + kRecordHeader <= bytes.size();) {
    const std::size_t kept = host_order(bytes, at + 8);
    if (kept > bytes.size() - at - kRecordHeader) break;
    if (auto datagram = parse_frame(bytes.substr(at + kRecordHeader, kept))) {
      datagram->seen = std::chrono::seconds(host_order(bytes, at)) +
                       Duration{host_order(bytes, at + 4) * fraction_ns};
      out.push_back(*datagram);
    }
    at += kRecordHeader + kept;
  }
  return out;
}

std::optional<std::uint64_t> parse_capture_drops(std::string_view text) {
  const std::size_t at = text.find(" packets dropped by kernel");
  if (at == std::string_view::npos) {
    return text.find("1 packet dropped by kernel") != std::string_view::npos
               ? std::optional<std::uint64_t>(1)
               : std::nullopt;
  }
  const std::size_t begin = text.rfind('\n', at);
  return number<std::uint64_t>(text.substr(begin == std::string_view::npos ? 0 : begin + 1,
                                           at - (begin == std::string_view::npos ? 0 : begin + 1)));
}

}  // namespace interneuron::netns::verify
