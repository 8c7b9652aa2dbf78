#include "node/monitor/netlink.h"

#include <linux/rtnetlink.h>
#include <netlink/errno.h>
#include <netlink/route/rtnl.h>
#include <sys/socket.h>

#include <algorithm>

#include "interneuron/transport.h"

namespace interneuron::io::netlink {

namespace {

// How often a listing is tried again that a change has interrupted. Changes come in bursts. No
// measurement behind this value: it only has to be larger than the changes of one burst.
constexpr int kListAttempts = 20;

int hand_over(nl_msg* message, void* handler) {
  (*static_cast<const Handler*>(handler))(*nlmsg_hdr(message));
  return NL_OK;
}

void set_handler(nl_sock* socket, const Handler& handler) {
  nl_socket_modify_cb(socket, NL_CB_VALID, NL_CB_CUSTOM, &hand_over,
                      const_cast<Handler*>(&handler));
}

// Asks for a receive buffer beyond the system's limit, which the kernel grants only with
// CAP_NET_ADMIN in the first user namespace.
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
  // Events answer no request, so they carry no sequence number to check.
  nl_socket_disable_seq_check(socket.get());
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
    // struct rtgenmsg is enough: the kernel accepts it as the header of a listing of every kind.
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
      // ENOBUFS: the queue was full and events were lost.
      complete = false;
    else if (result < 0)
      return false;
  }
}

}  // namespace interneuron::io::netlink
