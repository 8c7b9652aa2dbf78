#include "host/io/netlink.h"

#include <linux/rtnetlink.h>
#include <netlink/errno.h>
#include <netlink/route/rtnl.h>
#include <sys/socket.h>

#include <algorithm>

#include "interneuron/transport.h"

namespace interneuron::io::netlink {

namespace {

// Chosen: a listing is interrupted by each change, and changes come in bursts.
constexpr int kListAttempts = 20;

int hand_over(nl_msg* message, void* handler) {
  (*static_cast<const Handler*>(handler))(*nlmsg_hdr(message));
  return NL_OK;
}

void set_handler(nl_sock* socket, const Handler& handler) {
  nl_socket_modify_cb(socket, NL_CB_VALID, NL_CB_CUSTOM, &hand_over,
                      const_cast<Handler*>(&handler));
}

// Beyond the system's limit only with CAP_NET_ADMIN in the first user namespace.
void set_receive_buffer(nl_sock* socket, std::size_t bytes) {
  const int wanted = static_cast<int>(std::min<std::size_t>(bytes, 1 << 30));
  const int fd = nl_socket_get_fd(socket);
  if (::setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &wanted, sizeof wanted) == 0) return;
  ::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &wanted, sizeof wanted);
}

}  // namespace

void check(int result, const std::string& attempt) {
  if (result >= 0) return;
  throw IoError("cannot " + attempt + ": " + nl_geterror(result) +
                    " (routing netlink must be allowed: AF_NETLINK sockets)",
                0);
}

Socket open_socket() {
  Socket socket(nl_socket_alloc());
  if (!socket) check(-NLE_NOMEM, "read the network cards");
  check(nl_connect(socket.get(), NETLINK_ROUTE), "read the network cards");
  nl_socket_disable_auto_ack(socket.get());
  return socket;
}

Socket open_event_socket(std::initializer_list<int> groups, std::size_t receive_buffer_bytes) {
  static const std::string attempt = "watch the network cards";
  Socket socket = open_socket();
  nl_socket_disable_seq_check(socket.get());  // nobody asked for events
  check(nl_socket_set_nonblocking(socket.get()), attempt);
  set_receive_buffer(socket.get(), receive_buffer_bytes);
  for (const int group : groups) check(nl_socket_add_membership(socket.get(), group), attempt);
  return socket;
}

int ask(nl_sock* socket, nl_msg* request, const Handler& handler) {
  set_handler(socket, handler);
  if (const int result = nl_send_auto(socket, request); result < 0) return result;
  return std::min(nl_recvmsgs_default(socket), 0);
}

int list(nl_sock* socket, int type, const Handler& handler) {
  set_handler(socket, handler);
  int result = 0;
  for (int attempt = 0; attempt < kListAttempts; ++attempt) {
    // Kernels know which message a request of this size is: struct rtgenmsg fits all kinds.
    result = nl_rtgen_request(socket, type, AF_UNSPEC, NLM_F_DUMP);
    if (result < 0) return result;
    result = nl_recvmsgs_default(socket);
    if (result != -NLE_DUMP_INTR) break;
  }
  return std::min(result, 0);
}

bool drain(nl_sock* socket, const Handler& handler) {
  set_handler(socket, handler);
  bool complete = true;
  for (;;) {
    const int result = nl_recvmsgs_default(socket);
    if (result == -NLE_AGAIN) return complete;
    if (result == -NLE_NOMEM)
      complete = false;  // ENOBUFS: the queue was full
    else if (result < 0)
      return false;
  }
}

}  // namespace interneuron::io::netlink
