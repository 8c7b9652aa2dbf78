#include "node/ring/ring_filter.h"

#include <linux/if_packet.h>

#include <cstddef>
#include <utility>

#include "node/ring/frame.h"

namespace interneuron::io {

namespace {

// Where the type of an Ethernet frame stands, and how far a VLAN tag moves what follows.
constexpr std::uint32_t kEtherTypeAt = 12;
constexpr std::uint32_t kVlanTagBytes = 4;
constexpr std::uint32_t kFilteredTags = 2;
// The offset within the packet that a fragment claims: in the word of IPv4, and in that of IPv6.
constexpr std::uint32_t kOffset4 = 0x1fff;
constexpr std::uint32_t kOffset6 = 0xfff8;
// What a filter returns for "all of it".
constexpr std::uint32_t kWhole = 0xffffffff;

// A program in the making. Its instructions test one thing after another; what fails a test jumps
// to the end of the section, which the next section begins at.
class Program {
 public:
  void load_byte(std::uint32_t at) { add(BPF_LD | BPF_B | BPF_ABS, at); }
  void load_half(std::uint32_t at) { add(BPF_LD | BPF_H | BPF_ABS, at); }
  // The length of an IPv4 header, for load_half_behind().
  void measure_ipv4(std::uint32_t at) { add(BPF_LDX | BPF_B | BPF_MSH, at); }
  void load_half_behind(std::uint32_t at) { add(BPF_LD | BPF_H | BPF_IND, at); }
  void drop_unless(std::uint32_t value) {
    code_.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 1, 0));
    drop();
  }
  void need(std::uint32_t value) { test(BPF_JMP | BPF_JEQ | BPF_K, value, false); }
  void need_none_of(std::uint32_t bits) { test(BPF_JMP | BPF_JSET | BPF_K, bits, true); }
  // Goes on when it is one of two values.
  void need_either(std::uint32_t one, std::uint32_t other) {
    code_.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, one, 1, 0));
    need(other);
  }
  void pass() { add(BPF_RET | BPF_K, kWhole); }
  void drop() { add(BPF_RET | BPF_K, 0); }
  // What has failed a test since the last call goes on here.
  void end_section() {
    for (const auto& [at, when_true] : open_) {
      const auto distance = static_cast<std::uint8_t>(code_.size() - at - 1);
      (when_true ? code_[at].jt : code_[at].jf) = distance;
    }
    open_.clear();
  }
  std::vector<sock_filter> take() { return std::move(code_); }

 private:
  struct Jump {
    std::size_t at;
    bool when_true;
  };

  void add(unsigned code, std::uint32_t value) {
    code_.push_back(BPF_STMT(static_cast<std::uint16_t>(code), value));
  }
  void test(unsigned code, std::uint32_t value, bool when_true) {
    open_.push_back({code_.size(), when_true});
    code_.push_back(BPF_JUMP(static_cast<std::uint16_t>(code), value, 0, 0));
  }

  std::vector<sock_filter> code_;
  std::vector<Jump> open_;
};

// Passes an IPv4 packet that begins at `at`.
void pass_ipv4(Program& program, std::uint32_t at, std::uint16_t port) {
  program.load_byte(at + 9);
  program.need(kUdp);
  program.load_half(at + 6);
  program.need_none_of(kOffset4);
  program.measure_ipv4(at);
  program.load_half_behind(at + 2);
  program.need(port);
  program.pass();
}

// Passes an IPv6 packet, or the first fragment of one.
void pass_ipv6(Program& program, std::uint32_t at, std::uint16_t port, bool fragment) {
  constexpr std::uint32_t kHeaderBytes = 40;
  constexpr std::uint32_t kFragmentBytes = 8;
  std::uint32_t udp_at = at + kHeaderBytes;
  program.load_byte(at + 6);
  program.need(fragment ? kFragmentHeader : kUdp);
  if (fragment) {
    program.load_byte(udp_at);
    program.need(kUdp);
    program.load_half(udp_at + 2);
    program.need_none_of(kOffset6);
    udp_at += kFragmentBytes;
  }
  program.load_half(udp_at + 2);
  program.need(port);
  program.pass();
}

}  // namespace

std::vector<sock_filter> ring_filter(const RingFilter& wanted) {
  Program program;
  program.load_byte(static_cast<std::uint32_t>(SKF_AD_OFF + SKF_AD_PKTTYPE));
  program.drop_unless(PACKET_HOST);
  for (std::uint32_t tags = 0; tags <= (wanted.ethernet ? kFilteredTags : 0); ++tags) {
    const std::uint32_t type_at = kEtherTypeAt + tags * kVlanTagBytes;
    for (const bool fragment : {false, true}) {
      if (fragment && !wanted.ipv6) continue;
      for (std::uint32_t tag = kEtherTypeAt; wanted.ethernet && tag < type_at;
           tag += kVlanTagBytes) {
        program.load_half(tag);
        program.need_either(kTypeTag, kTypeServiceTag);
      }
      if (wanted.ethernet) {
        program.load_half(type_at);
        program.need(wanted.ipv6 ? kTypeIpv6 : kTypeIpv4);
      }
      const std::uint32_t at = wanted.ethernet ? type_at + 2 : 0;
      if (wanted.ipv6) {
        pass_ipv6(program, at, wanted.port, fragment);
      } else {
        pass_ipv4(program, at, wanted.port);
      }
      program.end_section();
    }
  }
  program.drop();
  return program.take();
}

std::vector<sock_filter> drop_all_filter() { return {BPF_STMT(BPF_RET | BPF_K, 0)}; }

}  // namespace interneuron::io
