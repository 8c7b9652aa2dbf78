// The kernel's routing netlink through libnl: owners of its objects and the three ways to use it:
// to ask for one thing, to list all of a kind, to be told of changes. Sockets belong to the network
// namespace in which they were opened. Thread-compatible. Errors: IoError where said.
#pragma once

#include <netlink/addr.h>
#include <netlink/msg.h>
#include <netlink/netlink.h>
#include <netlink/route/link.h>
#include <netlink/socket.h>

#include <functional>
#include <initializer_list>
#include <memory>
#include <string>

namespace interneuron::io::netlink {

template <auto Function>
struct Deleter {
  template <class T>
  void operator()(T* object) const {
    Function(object);
  }
};
using Socket = std::unique_ptr<nl_sock, Deleter<nl_socket_free>>;
using Message = std::unique_ptr<nl_msg, Deleter<nlmsg_free>>;
using Link = std::unique_ptr<rtnl_link, Deleter<rtnl_link_put>>;
using Address = std::unique_ptr<nl_addr, Deleter<nl_addr_put>>;

using Handler = std::function<void(const nlmsghdr&)>;

// For ask() and list(). Throws IoError.
Socket open_socket();

// Never blocks; told of changes in these groups (RTNLGRP_LINK, …). Throws IoError.
Socket open_event_socket(std::initializer_list<int> groups, std::size_t receive_buffer_bytes);

// Sends a request and hands over the answer; 0, or a negative error of libnl or the kernel.
int ask(nl_sock* socket, nl_msg* request, const Handler& handler);

// Hands over every object of a kind (RTM_GETLINK, …); the same result. What changes meanwhile may
// be handed over twice.
int list(nl_sock* socket, int type, const Handler& handler);

// Hands over what has come; false when events were lost in between.
bool drain(nl_sock* socket, const Handler& handler);

// Throws IoError when `result` is negative.
void check(int result, const std::string& attempt);

}  // namespace interneuron::io::netlink
