// Segmentation offloads of a NIC, by the ethtool ioctl.
#pragma once

#include <string>

namespace interneuron::netns {

// Turns every segmentation offload (TSO, GSO, USO) and GRO of a NIC of the current network
// namespace off, so that the emulator sees packets as they would be on the air, one by one.
// Checksum offload stays on: without it kernels before 6.11 refuse UDP_SEGMENT with EIO
// (udp_send_skb), and the emulator completes checksums. Throws TestbedError.
void disable_segmentation_offloads(const std::string& nic);

}  // namespace interneuron::netns
