// Several UDP sockets that serve one address of a NIC together, each for a thread of its own, and
// which of them a packet is for.
//
// The kernel chooses the socket (SO_REUSEPORT) by a program of ours of classic BPF, which reads
// what shard.h says of a packet: the first message of a handshake is for the door, everything else
// for the shard that the last byte of its session tells. That byte is the same on all paths of a
// peer, whatever addresses they lead to. The kernel's program counts sockets in the order in which
// they were bound and has no say in packets that were coalesced or that waited when a socket
// closed; so whoever receives a packet asks shard_of_packet() again and hands on what is not for
// him. Needs no privilege.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "interneuron/transport.h"
#include "node/io/udp_socket.h"

namespace interneuron::io {

// Whom a datagram is for among `shards`: 1 … shards, or 0, the door. Any bytes may come.
std::uint8_t shard_of_packet(ByteView packet, std::uint8_t shards, bool encrypted);

struct SocketGroup {
  // The door's, then those of the shards in their order.
  std::vector<std::unique_ptr<Transport>> transports;
  std::vector<std::string> warnings;
};
// Opens them all. Throws IoError, also where anybody else has the port, who could otherwise be
// given a part of what comes in.
SocketGroup open_socket_group(const UdpOptions& options, std::uint8_t shards, bool encrypted);

// What tools such as top call the calling thread: at most 15 characters.
void name_this_thread(const std::string& name);

}  // namespace interneuron::io
