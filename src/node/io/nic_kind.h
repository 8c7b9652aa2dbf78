// What kind of thing a network card (NIC) is.
#pragma once

#include <string>
#include <string_view>

#include "node/io/nic.h"

namespace interneuron::io {

struct NicOrigin {
  // As Nic::kind and Nic::driver.
  std::string kind;
  std::string driver;
};

// `nic`: its name, index and hardware address; `virtual_kind`: what the kernel calls a NIC made of
// software (IFLA_INFO_KIND), empty for hardware. Reads sysfs, and asks the driver where sysfs shows
// another network namespace. Thread-safe.
NicOrigin origin_of(const Nic& nic, bool loopback, std::string_view virtual_kind);

}  // namespace interneuron::io
