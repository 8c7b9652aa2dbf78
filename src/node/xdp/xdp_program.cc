#include "node/xdp/xdp_socket.h"

#include <arpa/inet.h>
#include <bpf/bpf.h>
#include <linux/if_ether.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "interneuron/transport.h"
#include "node/io/this_program.h"

namespace interneuron::io {

namespace {

// The licence that the kernel is told of the program.
constexpr const char* kLicence = "Apache-2.0";

// Sizes of headers, bytes, and where their fields stand.
constexpr std::int16_t kEthernetBytes = 14;
constexpr std::int16_t kTypeAt = 12;
constexpr std::int16_t kTagBytes = 4;
constexpr std::int16_t kIpv4Bytes = 20;
constexpr std::int16_t kIpv6Bytes = 40;
constexpr std::int16_t kUdpBytes = 8;
constexpr std::int32_t kVlanMask = 0x0fff;
// Fragment offsets of IPv4. First fragments are taken, so that they are counted as refused.
constexpr std::int32_t kOffsetMask = 0x1fff;
// The length of a header of IPv4: which bits of its first byte say it, and in words of how many
// bytes (RFC 791 §3.1).
constexpr std::int32_t kLengthMask = 0x0f;
constexpr std::int32_t kWordBytes = 4;

// Registers of the virtual machine: results and arguments of calls, which leave the first five
// undefined; those that survive calls; the frame of the stack.
enum Register : std::uint8_t {
  kResult = BPF_REG_0,
  kFirst = BPF_REG_1,
  kSecond = BPF_REG_2,
  kThird = BPF_REG_3,
  kValue = BPF_REG_4,
  kPacket = BPF_REG_5,
  kContext = BPF_REG_6,
  kIp = BPF_REG_7,
  kEnd = BPF_REG_8,
  kTime = BPF_REG_9,
  kStack = BPF_REG_10,
};

// A program in the making. What fails a test goes on to the kernel.
class Assembler {
 public:
  void add(int code, int to, int from, int offset, std::int32_t value) {
    bpf_insn out{};
    out.code = static_cast<std::uint8_t>(code);
    out.dst_reg = static_cast<std::uint8_t>(to & 0x0f);
    out.src_reg = static_cast<std::uint8_t>(from & 0x0f);
    out.off = static_cast<std::int16_t>(offset);
    out.imm = value;
    code_.push_back(out);
  }
  void copy(Register to, Register from) { add(BPF_ALU64 | BPF_MOV | BPF_X, to, from, 0, 0); }
  void set(Register to, std::int32_t value) { add(BPF_ALU64 | BPF_MOV | BPF_K, to, 0, 0, value); }
  void increase(Register to, std::int32_t by) { add(BPF_ALU64 | BPF_ADD | BPF_K, to, 0, 0, by); }
  void mask(Register to, std::int32_t bits) { add(BPF_ALU64 | BPF_AND | BPF_K, to, 0, 0, bits); }
  void load(int size, Register to, Register from, int offset) {
    add(BPF_LDX | BPF_MEM | size, to, from, offset, 0);
  }
  // A field of two bytes in the order of the network.
  void load_field(Register to, Register from, int offset) {
    load(BPF_H, to, from, offset);
    add(BPF_ALU | BPF_END | BPF_TO_BE, to, 0, 0, 16);
  }
  void store(int size, Register to, int offset, Register from) {
    add(BPF_STX | BPF_MEM | size, to, from, offset, 0);
  }
  void store(int size, Register to, int offset, std::int32_t value) {
    add(BPF_ST | BPF_MEM | size, to, 0, offset, value);
  }
  void load_map(Register to, int map) {
    add(BPF_LD | BPF_IMM | BPF_DW, to, BPF_PSEUDO_MAP_FD, 0, map);
    add(0, 0, 0, 0, 0);
  }
  void call(int function) { add(BPF_JMP | BPF_CALL, 0, 0, 0, function); }
  void end() { add(BPF_JMP | BPF_EXIT, 0, 0, 0, 0); }

  void need(Register what, std::int32_t value) { give_up_if(BPF_JNE | BPF_K, what, 0, value); }
  void need_not(Register what, std::int32_t value) { give_up_if(BPF_JEQ | BPF_K, what, 0, value); }
  void need_at_least(Register what, std::int32_t value) {
    give_up_if(BPF_JLT | BPF_K, what, 0, value);
  }
  // That so many bytes behind `from` are within the frame.
  void need_bytes(Register from, std::int32_t bytes) {
    copy(kValue, from);
    increase(kValue, bytes);
    give_up_if(BPF_JGT | BPF_X, kValue, kEnd, 0);
  }
  // Goes on behind the next land(), if the condition holds, or in any case.
  std::size_t jump_if(int condition, Register one, int other, std::int32_t value) {
    add(BPF_JMP | condition, one, other, 0, value);
    return code_.size() - 1;
  }
  void land(std::size_t jump) {
    code_[jump].off = static_cast<std::int16_t>(code_.size() - jump - 1);
  }
  // What has failed a test goes on here.
  void land_failed() {
    for (const std::size_t jump : failed_) land(jump);
    failed_.clear();
  }
  std::vector<bpf_insn> take() { return std::move(code_); }

 private:
  void give_up_if(int condition, Register one, int other, std::int32_t value) {
    failed_.push_back(jump_if(condition, one, other, value));
  }

  std::vector<bpf_insn> code_;
  std::vector<std::size_t> failed_;
};

// Leaves kIp where the IP header begins, behind a tag if there is one.
void find_ip(Assembler& code, bool ipv6) {
  code.need_bytes(kPacket, kEthernetBytes);
  code.load_field(kFirst, kPacket, kTypeAt);
  code.copy(kIp, kPacket);
  code.increase(kIp, kEthernetBytes);
  const std::int32_t tags[] = {ETH_P_8021Q, ETH_P_8021AD};
  const std::size_t tagged = code.jump_if(BPF_JEQ | BPF_K, kFirst, 0, tags[0]);
  const std::size_t untagged = code.jump_if(BPF_JNE | BPF_K, kFirst, 0, tags[1]);
  code.land(tagged);
  code.need_bytes(kIp, kTagBytes);
  code.load_field(kFirst, kIp, 0);
  code.mask(kFirst, kVlanMask);
  code.need(kFirst, 0);
  code.load_field(kFirst, kIp, kTagBytes - 2);
  code.increase(kIp, kTagBytes);
  code.land(untagged);
  code.need(kFirst, ipv6 ? ETH_P_IPV6 : ETH_P_IP);
}

// Moves kPacket behind a header of IPv4 whose length in words stands in kFirst, by one constant
// after the other: to add what stands in a register to a pointer into the frame is forbidden
// without CAP_PERFMON, as a measure against Spectre.
void skip_ipv4_header(Assembler& code) {
  constexpr std::int32_t kLeastWords = kIpv4Bytes / kWordBytes;
  code.need_at_least(kFirst, kLeastWords);
  code.increase(kPacket, kIpv4Bytes);
  std::vector<std::size_t> ended;
  for (std::int32_t words = kLeastWords + 1; words <= kLengthMask; ++words) {
    ended.push_back(code.jump_if(BPF_JLT | BPF_K, kFirst, 0, words));
    code.increase(kPacket, kWordBytes);
  }
  for (const std::size_t jump : ended) code.land(jump);
}

// Leaves kPacket where the UDP header begins, and the destination on the stack, at its end. A word
// of 8 bytes of the stack that half of a register was stored in is not written again: Linux 6.1
// forbids that without CAP_PERFMON.
void find_udp(Assembler& code, bool ipv6) {
  code.need_bytes(kIp, ipv6 ? kIpv6Bytes : kIpv4Bytes);
  code.load(BPF_B, kFirst, kIp, ipv6 ? 6 : 9);
  code.need(kFirst, IPPROTO_UDP);
  code.copy(kPacket, kIp);
  if (ipv6) {
    for (const int at : {0, 8}) {
      code.load(BPF_DW, kFirst, kIp, 24 + at);
      code.store(BPF_DW, kStack, -16 + at, kFirst);
    }
    code.increase(kPacket, kIpv6Bytes);
    return;
  }
  code.load_field(kFirst, kIp, 6);
  code.mask(kFirst, kOffsetMask);
  code.need(kFirst, 0);
  for (const int at : {-16, -8}) code.store(BPF_DW, kStack, at, 0);
  code.load(BPF_W, kFirst, kIp, 16);
  code.store(BPF_W, kStack, -16, kFirst);
  // The length of the header, in words of 4 bytes.
  code.load(BPF_B, kFirst, kIp, 0);
  code.mask(kFirst, kLengthMask);
  skip_ipv4_header(code);
}

// Where the driver does not leave room, the frame comes without.
void put_stamp(Assembler& code) {
  code.call(BPF_FUNC_ktime_get_ns);
  code.copy(kTime, kResult);
  code.copy(kFirst, kContext);
  code.set(kSecond, -static_cast<std::int32_t>(sizeof(XdpStamp)));
  code.call(BPF_FUNC_xdp_adjust_meta);
  const std::size_t refused = code.jump_if(BPF_JNE | BPF_K, kResult, 0, 0);
  code.load(BPF_W, kFirst, kContext, offsetof(xdp_md, data_meta));
  code.load(BPF_W, kSecond, kContext, offsetof(xdp_md, data));
  code.copy(kThird, kFirst);
  code.increase(kThird, sizeof(XdpStamp));
  const std::size_t no_room = code.jump_if(BPF_JGT | BPF_X, kThird, kSecond, 0);
  code.store(BPF_DW, kFirst, 0, kTime);
  code.land(refused);
  code.land(no_room);
}

[[noreturn]] void program_failed(const std::string& nic, const char* call, int error) {
  if (error == EPERM || error == EACCES) {
    throw IoError("not permitted to put an XDP program on " + nic + " (" + call +
                      "); run `sudo setcap cap_net_raw,cap_net_admin,cap_bpf,cap_ipc_lock+ep " +
                      this_program() + "`, run as root of the host, or use --transport udp",
                  EPERM);
  }
  if (error == EBUSY || error == EEXIST) {
    throw IoError("another XDP program is on " + nic + " (" + call +
                      "); end it, or use --transport ring or udp",
                  EBUSY);
  }
  throw IoError("cannot put an XDP program on " + nic + " (" + call + ": " + std::strerror(error) +
                    "); an MTU above 3000 may be the cause; use --transport "
                    "ring or udp",
                error);
}

int new_map(const std::string& nic, bpf_map_type type, std::uint32_t key, std::uint32_t value,
            std::uint32_t entries) {
  const int map = ::bpf_map_create(type, nullptr, key, value, entries, nullptr);
  if (map < 0) program_failed(nic, "bpf BPF_MAP_CREATE", -map);
  return map;
}

int new_address_map(const std::string& nic) {
  return new_map(nic, BPF_MAP_TYPE_HASH, sizeof(XdpProgram::Key), 1, XdpProgram::kMostAddresses);
}

int new_socket_map(const std::string& nic, std::uint32_t queues) {
  return new_map(nic, BPF_MAP_TYPE_XSKMAP, sizeof(std::uint32_t), sizeof(std::uint32_t), queues);
}

int load(const std::string& nic, const std::vector<bpf_insn>& code) {
  const int program = ::bpf_prog_load(BPF_PROG_TYPE_XDP, "interneuron", kLicence, code.data(),
                                      code.size(), nullptr);
  if (program < 0) program_failed(nic, "bpf BPF_PROG_LOAD", -program);
  return program;
}

int attach(const std::string& nic, int program, int index) {
  const int link = ::bpf_link_create(program, index, BPF_XDP, nullptr);
  if (link < 0) program_failed(nic, "bpf BPF_LINK_CREATE", -link);
  return link;
}

}  // namespace

std::vector<bpf_insn> xdp_filter(const XdpFilter& wanted) {
  Assembler code;
  code.copy(kContext, kFirst);
  code.load(BPF_W, kPacket, kContext, offsetof(xdp_md, data));
  code.load(BPF_W, kEnd, kContext, offsetof(xdp_md, data_end));
  find_ip(code, wanted.ipv6);
  find_udp(code, wanted.ipv6);
  code.need_bytes(kPacket, kUdpBytes);
  code.load_field(kFirst, kPacket, 2);
  code.need(kFirst, wanted.port);
  code.load_map(kFirst, wanted.addresses);
  code.copy(kSecond, kStack);
  code.increase(kSecond, -16);
  code.call(BPF_FUNC_map_lookup_elem);
  code.need_not(kResult, 0);
  put_stamp(code);
  code.load_map(kFirst, wanted.sockets);
  code.load(BPF_W, kSecond, kContext, offsetof(xdp_md, rx_queue_index));
  // What becomes of a frame of a queue without a socket.
  code.set(kThird, XDP_PASS);
  code.call(BPF_FUNC_redirect_map);
  code.end();
  code.land_failed();
  code.set(kResult, XDP_PASS);
  code.end();
  return code.take();
}

// With maps and programs as they are used: what the kernel allows of a program depends on its
// instructions as well as on the capabilities of who loads it.
void XdpProgram::require_privilege() {
  const std::string nic = "any network card";
  const FileDescriptor addresses(new_address_map(nic));
  const FileDescriptor sockets(new_socket_map(nic, 1));
  for (const bool ipv6 : {false, true}) {
    const FileDescriptor program(load(
        nic,
        xdp_filter(
            {.ipv6 = ipv6, .port = 0, .addresses = addresses.get(), .sockets = sockets.get()})));
  }
  const FileDescriptor socket(::socket(AF_XDP, SOCK_RAW | SOCK_CLOEXEC, 0));
  if (socket.get() < 0) program_failed(nic, "socket AF_XDP", errno);
}

XdpProgram::XdpProgram(int index, const std::string& nic, bool ipv6, std::uint16_t port,
                       std::uint32_t queues)
    : nic_(nic),
      addresses_(new_address_map(nic)),
      sockets_(new_socket_map(nic, queues)),
      program_(load(nic, xdp_filter({.ipv6 = ipv6,
                                     .port = port,
                                     .addresses = addresses_.get(),
                                     .sockets = sockets_.get()}))),
      link_(attach(nic, program_.get(), index)) {}

void XdpProgram::add_socket(std::uint32_t queue, int socket) {
  const int result = ::bpf_map_update_elem(sockets_.get(), &queue, &socket, BPF_ANY);
  if (result < 0) program_failed(nic_, "bpf BPF_MAP_UPDATE_ELEM", -result);
}

void XdpProgram::take_addresses(std::span<const Address> addresses) {
  std::set<Key> wanted;
  for (const Address& address : addresses) {
    Key key{};
    const bool ipv6 = is_ipv6(address);
    std::memcpy(
        key.data(),
        &address.raw[ipv6 ? offsetof(sockaddr_in6, sin6_addr) : offsetof(sockaddr_in, sin_addr)],
        ipv6 ? sizeof(in6_addr) : sizeof(in_addr));
    wanted.insert(key);
  }
  constexpr std::uint8_t kThere = 1;
  for (const Key& key : known_) {
    if (!wanted.contains(key)) ::bpf_map_delete_elem(addresses_.get(), key.data());
  }
  for (const Key& key : wanted) {
    if (!known_.contains(key)) {
      ::bpf_map_update_elem(addresses_.get(), key.data(), &kThere, BPF_ANY);
    }
  }
  known_ = std::move(wanted);
}

}  // namespace interneuron::io
