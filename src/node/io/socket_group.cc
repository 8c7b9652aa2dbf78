#include "node/io/socket_group.h"

#include <linux/filter.h>
#include <pthread.h>

#include <array>
#include <cerrno>
#include <span>

#include "core/wire/header.h"
#include "interneuron/shard.h"

namespace interneuron::io {
namespace {

// Where the type and the epoch of a packet lie (docs/wire_format.md, "Packet").
constexpr std::uint32_t kTypeAt = 0;
constexpr std::uint32_t kEpochAt = 1;
constexpr std::uint32_t kTypeBits = 0x0f;
constexpr auto kInitiation = static_cast<std::uint32_t>(wire::PacketType::kInitiation);

constexpr sock_filter step(unsigned code, std::uint32_t value, std::uint8_t if_true = 0,
                           std::uint8_t if_false = 0) {
  return {static_cast<std::uint16_t>(code), if_true, if_false, value};
}

// shard_of_packet() for the kernel, which gives the program the UDP payload; one that is too short
// is given to the door, which counts it.
void attach_program(int fd, const std::string& nic, std::uint8_t shards, bool encrypted) {
  std::array<sock_filter, 10> program{
      step(BPF_LD | BPF_B | BPF_ABS, kEpochAt),
      step(BPF_JMP | BPF_JEQ | BPF_K, wire::kClearEpoch, 0, 4),
      step(BPF_LD | BPF_B | BPF_ABS, kTypeAt),
      step(BPF_ALU | BPF_AND | BPF_K, kTypeBits),
      step(BPF_JMP | BPF_JEQ | BPF_K, kInitiation, 0, 1),
      step(BPF_RET | BPF_K, 0),
      step(BPF_LD | BPF_B | BPF_ABS, kShardByteAt),
      step(BPF_ALU | BPF_MOD | BPF_K, shards),
      step(BPF_ALU | BPF_ADD | BPF_K, 1),
      step(BPF_RET | BPF_A, 0),
  };
  constexpr std::size_t kOfSession = 6;
  const std::span<sock_filter> steps = std::span(program).subspan(encrypted ? 0 : kOfSession);
  const sock_fprog filter{static_cast<std::uint16_t>(steps.size()), steps.data()};
  if (::setsockopt(fd, SOL_SOCKET, SO_ATTACH_REUSEPORT_CBPF, &filter, sizeof filter) == 0) return;
  throw IoError("cannot divide the packets of " + nic +
                    " between several sockets (setsockopt SO_ATTACH_REUSEPORT_CBPF: " +
                    std::strerror(errno) + "); take one shard",
                errno);
}

}  // namespace

std::uint8_t shard_of_packet(ByteView packet, std::uint8_t shards, bool encrypted) {
  if (packet.size() <= kShardByteAt) return 0;
  const auto byte = [&](std::size_t at) { return std::to_integer<std::uint8_t>(packet[at]); };
  if (encrypted && byte(kEpochAt) == wire::kClearEpoch &&
      (byte(kTypeAt) & kTypeBits) == kInitiation) {
    return 0;
  }
  return shard_of_byte(byte(kShardByteAt), shards);
}

// The first one is bound like any other socket, which fails where somebody has the port, and lets
// others join afterwards.
SocketGroup open_socket_group(const UdpOptions& options, std::uint8_t shards, bool encrypted) {
  SocketGroup group;
  UdpOptions each = options;
  each.notes = std::make_shared<ReceiverNotes>();
  auto first = std::make_unique<UdpTransport>(each);
  const int fd = first->native_handle();
  const int on = 1;
  if (::setsockopt(fd, SOL_SOCKET, SO_REUSEPORT, &on, sizeof on) != 0) {
    throw IoError("cannot share the port on " + options.nic +
                      " (setsockopt SO_REUSEPORT: " + std::strerror(errno) + "); take one shard",
                  errno);
  }
  each.local = first->local_address();
  each.joins = true;
  group.warnings = first->warnings();
  group.transports.push_back(std::move(first));
  for (std::uint8_t i = 0; i < shards; ++i) {
    group.transports.push_back(std::make_unique<UdpTransport>(each));
  }
  attach_program(fd, options.nic, shards, encrypted);
  return group;
}

void name_this_thread(const std::string& name) {
  ::pthread_setname_np(::pthread_self(), name.c_str());
}

}  // namespace interneuron::io
