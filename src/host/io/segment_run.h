// Which datagrams of a batch can leave in one call that the kernel or the NIC segments
// (UDP_SEGMENT). Pure. Thread-safe; no errors.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "interneuron/transport.h"

namespace interneuron::io {

// Datagrams per call that is segmented: UDP_MAX_SEGMENTS of Linux < 6.9.
inline constexpr std::size_t kMaxSegments = 64;
// Bytes of all of them, the UDP payload over IPv4: 65535 - 20 - 8.
inline constexpr std::size_t kMaxSegmentedBytes = 65507;

// Messages per sendmmsg, each of which is several datagrams that the kernel segments: 32 of 45 full
// datagrams are 2 MB, four times the socket's buffer.
inline constexpr std::size_t kSendMessages = 32;
// Parts of datagrams per sendmmsg: 682 datagrams of three parts. UIO_MAXIOV allows 1024 in each
// message.
inline constexpr std::size_t kMostParts = 3;
inline constexpr std::size_t kSendVectors = 2048;
// After so many refusals in a row segmentation stays off, so that a NIC that cannot do it does not
// cost a failed call per batch. No measurement behind this value: it only has to be larger than the
// refusals that a passing change of the MTU causes.
inline constexpr std::size_t kRefusalsToGiveUp = 8;

// How many leading datagrams can leave together: they go to the same address with the same ECN bits
// and have the same size; only the last may be shorter. `batch` is not empty.
inline std::size_t run_length(std::span<const Outgoing> batch) {
  const std::size_t segment = batch[0].size();
  std::size_t total = segment;
  std::size_t count = 1;
  while (count < std::min(batch.size(), kMaxSegments)) {
    const Outgoing& next = batch[count];
    const std::size_t size = next.size();
    total += size;
    if (size == 0 || size > segment || total > kMaxSegmentedBytes || next.to != batch[0].to ||
        next.ecn != batch[0].ecn) {
      break;
    }
    ++count;
    if (size < segment) break;
  }
  return count;
}

}  // namespace interneuron::io
