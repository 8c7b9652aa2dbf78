#include "netns/wiring/offloads.h"

#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "netns/state/check.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

namespace {

// Memory for a structure of ethtool that ends in an array of a length known at run time; zeroed and
// aligned for its widest member.
template <class Header>
class EthtoolBuffer {
 public:
  explicit EthtoolBuffer(std::size_t tail_bytes)
      : words_((sizeof(Header) + tail_bytes + sizeof(std::uint64_t) - 1) / sizeof(std::uint64_t)) {}
  Header* get() { return reinterpret_cast<Header*>(words_.data()); }

 private:
  std::vector<std::uint64_t> words_;
};

// The ethtool ioctl of one NIC of the current network namespace. Errors: TestbedError.
class Ethtool {
 public:
  explicit Ethtool(const std::string& nic)
      : nic_(nic),
        socket_(check(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), "open a socket")) {}

  // `command` is a structure that begins with the number of the command; the answer is in it.
  void call(void* command) const {
    ifreq request{};
    nic_.copy(request.ifr_name, IFNAMSIZ - 1);
    request.ifr_data = static_cast<char*>(command);
    check(::ioctl(socket_.get(), SIOCETHTOOL, &request), "set the offloads of " + nic_);
  }

  // The names of all features that the kernel knows, in the order of their bits.
  std::vector<std::string> feature_names() const {
    EthtoolBuffer<ethtool_sset_info> info(sizeof(std::uint32_t));
    info.get()->cmd = ETHTOOL_GSSET_INFO;
    info.get()->sset_mask = std::uint64_t{1} << ETH_SS_FEATURES;
    call(info.get());
    const std::size_t count = info.get()->data[0];

    EthtoolBuffer<ethtool_gstrings> strings(count * ETH_GSTRING_LEN);
    strings.get()->cmd = ETHTOOL_GSTRINGS;
    strings.get()->string_set = ETH_SS_FEATURES;
    strings.get()->len = static_cast<std::uint32_t>(count);
    call(strings.get());
    std::vector<std::string> names;
    for (std::size_t i = 0; i < count; ++i) {
      const char* name = reinterpret_cast<const char*>(strings.get()->data) + i * ETH_GSTRING_LEN;
      names.emplace_back(name, ::strnlen(name, ETH_GSTRING_LEN));
    }
    return names;
  }

 private:
  std::string nic_;
  io::FileDescriptor socket_;
};

bool is_segmentation(std::string_view feature) {
  return feature.find("segmentation") != std::string_view::npos ||
         feature.substr(0, 7) == "tx-gso-" || feature == "rx-gro" || feature == "rx-gro-list" ||
         feature == "rx-udp-gro-forwarding";
}

}  // namespace

void disable_segmentation_offloads(const std::string& nic) {
  const Ethtool ethtool(nic);
  const std::vector<std::string> names = ethtool.feature_names();
  const std::size_t blocks = (names.size() + 31) / 32;

  EthtoolBuffer<ethtool_gfeatures> present(blocks * sizeof(ethtool_get_features_block));
  present.get()->cmd = ETHTOOL_GFEATURES;
  present.get()->size = static_cast<std::uint32_t>(blocks);
  ethtool.call(present.get());

  EthtoolBuffer<ethtool_sfeatures> wanted(blocks * sizeof(ethtool_set_features_block));
  wanted.get()->cmd = ETHTOOL_SFEATURES;
  wanted.get()->size = static_cast<std::uint32_t>(blocks);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::uint32_t bit = std::uint32_t{1} << (i % 32);
    // Asking for one feature that the driver cannot change would make the whole call fail.
    const bool changeable = (present.get()->features[i / 32].available & bit) != 0;
    if (changeable && is_segmentation(names[i])) wanted.get()->features[i / 32].valid |= bit;
  }
  ethtool.call(wanted.get());

  ethtool.call(present.get());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::uint32_t bit = std::uint32_t{1} << (i % 32);
    if ((wanted.get()->features[i / 32].valid & present.get()->features[i / 32].active & bit) !=
        0) {
      throw TestbedError(1, "cannot turn " + names[i] + " of " + nic + " off");
    }
  }
}

}  // namespace interneuron::netns
