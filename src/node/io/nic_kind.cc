#include "node/io/nic_kind.h"

#include <fcntl.h>
#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "node/io/file_descriptor.h"

namespace interneuron::io {

namespace {

// Drivers of cellular modems whose NICs neither the kernel's kind nor sysfs tells from Ethernet.
constexpr std::array kModemDrivers{"cdc_mbim", "huawei_cdc_ncm", "iosm",  "mhi_net",
                                   "mtk_t7xx", "qmi_wwan",       "rmnet", "sierra_net"};

std::string read_line(const std::string& path) {
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  std::array<char, 4096> text{};
  const ssize_t size = file.get() < 0 ? -1 : ::read(file.get(), text.data(), text.size());
  if (size <= 0) return {};
  const std::string_view all(text.data(), static_cast<std::size_t>(size));
  return std::string(all.ends_with('\n') ? all.substr(0, all.size() - 1) : all);
}

// Whether the folder of sysfs describes this NIC: sysfs shows the network namespace in which it was
// mounted, which may have another NIC of the same name.
bool shows(const std::string& folder, const Nic& nic) {
  if (read_line(folder + "/ifindex") != std::to_string(nic.index)) return false;
  return nic.mac.empty() || read_line(folder + "/address") == nic.mac;
}

bool exists(const std::string& path) { return ::access(path.c_str(), F_OK) == 0; }

// The driver's name, as sysfs or as the driver itself says it; empty when unknown.
std::string driver_by_sysfs(const std::string& folder) {
  std::array<char, 512> target{};
  const ssize_t size =
      ::readlink((folder + "/device/driver").c_str(), target.data(), target.size());
  if (size <= 0) return {};
  const std::string path(target.data(), static_cast<std::size_t>(size));
  return path.substr(path.rfind('/') + 1);
}

std::string driver_by_ioctl(const std::string& name) {
  const FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ethtool_drvinfo info{};
  info.cmd = ETHTOOL_GDRVINFO;
  ifreq request{};
  name.copy(request.ifr_name, IFNAMSIZ - 1);
  request.ifr_data = reinterpret_cast<char*>(&info);
  if (::ioctl(socket.get(), SIOCETHTOOL, &request) != 0) return {};
  return std::string(info.driver, ::strnlen(info.driver, sizeof info.driver));
}

// The value of DEVTYPE among the lines of uevent, for example "wlan" (linux/netdevice.h,
// SET_NETDEV_DEVTYPE).
std::string device_type(const std::string& folder) {
  static constexpr std::string_view kKey = "DEVTYPE=";
  const std::string lines = read_line(folder + "/uevent");
  const auto start = lines.find(kKey);
  if (start == std::string::npos) return {};
  const std::string rest = lines.substr(start + kKey.size());
  return rest.substr(0, rest.find('\n'));
}

// The kind of a NIC that is hardware; `known`: sysfs shows it.
std::string hardware_kind(const std::string& folder, bool known, const std::string& driver) {
  if (known) {
    const std::string type = device_type(folder);
    if (type == "wlan" || exists(folder + "/phy80211") || exists(folder + "/wireless")) {
      return "wifi";
    }
    // "wwan", "gadget", "bond", …
    if (!type.empty()) return type;
  }
  if (std::ranges::find(kModemDrivers, driver) != kModemDrivers.end()) return "wwan";
  return "ethernet";
}

}  // namespace

NicOrigin origin_of(const Nic& nic, bool loopback, std::string_view virtual_kind) {
  NicOrigin out;
  if (loopback) {
    out.kind = "loopback";
    return out;
  }
  const std::string folder = "/sys/class/net/" + nic.name;
  const bool known = shows(folder, nic);
  if (known) out.driver = driver_by_sysfs(folder);
  if (out.driver.empty()) out.driver = driver_by_ioctl(nic.name);
  // "wwan" covers the kernel's own framework; mhi_net and rmnet are modems' multiplexed channels.
  const bool modem_channel = virtual_kind == "rmnet" || virtual_kind == "mhi_net";
  out.kind = modem_channel           ? "wwan"
             : !virtual_kind.empty() ? std::string(virtual_kind)
                                     : hardware_kind(folder, known, out.driver);
  return out;
}

}  // namespace interneuron::io
