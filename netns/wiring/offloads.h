// Turns off segmentation offloads of a NIC by the ethtool ioctl. Thread-compatible. Errors:
// TestbedError.
#pragma once

#include <string>

namespace interneuron::netns {

// Turns off every segmentation offload (TSO, GSO, USO) and GRO of a NIC of the current network
// namespace, so that the emulator sees single packets, as they would be on the air. Checksum
// offload stays on, because without it kernels before 6.11 refuse UDP_SEGMENT with EIO
// (udp_send_skb); the emulator computes the checksums.
void disable_segmentation_offloads(const std::string& nic);

}  // namespace interneuron::netns
