#include "app/watch/live_state.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <mutex>
#include <optional>

#include "node/io/steady_clock.h"

namespace interneuron::watch {

namespace {

constexpr std::string_view kPrefix = "interneuron.live.";
// Readers at the same time. No measurement is behind this value: it only has to be larger than the
// number of people who look at one program.
constexpr std::size_t kMaxReaders = 8;
// Lines that a reader may miss in a row: 10 s of them, so that a reader that was stopped does not
// keep its place for ever.
constexpr int kMaxMissed = 20;
// Programs that a reader listens to. No measurement is behind this value: it only has to be larger
// than the number of programs on one host.
constexpr std::size_t kMaxPrograms = 64;
// The longest line that a reader takes; that of 64 NICs towards 64 peers is shorter.
constexpr std::size_t kMaxLineBytes = 8 * 1024 * 1024;

struct Name {
  sockaddr_un address{};
  socklen_t size = 0;
};

// An abstract address begins with a zero byte and has no file.
std::optional<Name> abstract(const std::string& name) {
  Name out;
  if (name.size() + 1 > sizeof out.address.sun_path) return std::nullopt;
  out.address.sun_family = AF_UNIX;
  name.copy(out.address.sun_path + 1, name.size());
  out.size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  return out;
}

bool same_user_or_root(int socket, uid_t root_counts) {
  ucred peer{};
  socklen_t size = sizeof peer;
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return false;
  return peer.uid == ::geteuid() || peer.uid == root_counts;
}

io::FileDescriptor stream_socket() {
  return io::FileDescriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
}

}  // namespace

struct LiveServer::Mailbox {
  std::mutex mutex;
  std::string line;
};

std::string LiveServer::own_name() { return std::string(kPrefix) + std::to_string(::getpid()); }

LiveServer::LiveServer(const std::string& name)
    : listener_(stream_socket()),
      wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      mailbox_(std::make_unique<Mailbox>()) {
  const auto where = abstract(name);
  if (!where || listener_.get() < 0 || wake_.get() < 0 ||
      ::bind(listener_.get(), reinterpret_cast<const sockaddr*>(&where->address), where->size) !=
          0 ||
      ::listen(listener_.get(), static_cast<int>(kMaxReaders)) != 0) {
    problem_ = "`interneuron links` and `top` cannot look at this program: socket @" + name + ": " +
               (where ? std::strerror(errno) : "name too long");
    return;
  }
  thread_ = std::thread([this] { serve(); });
}

LiveServer::~LiveServer() {
  stop_ = true;
  publish({});
  if (thread_.joinable()) thread_.join();
}

void LiveServer::publish(std::string line) {
  {
    const std::lock_guard lock(mailbox_->mutex);
    mailbox_->line = std::move(line);
  }
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t done = ::write(wake_.get(), &one, sizeof one);
}

void LiveServer::take_reader() {
  io::FileDescriptor socket(
      ::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
  if (socket.get() < 0 && errno != EAGAIN && errno != EINTR && errno != ECONNABORTED) {
    // The reader stays in the queue, so that poll() would return at once, for ever.
    paused_until_ = io::now() + kPause;
    ++refusals_;
  }
  if (socket.get() < 0 || readers_.size() >= kMaxReaders) return;
  if (!same_user_or_root(socket.get(), 0)) return;
  readers_.push_back({std::move(socket), {}});
}

// Sends as much of the line as the socket takes, which may be less than a line of many links. False
// when the reader has gone.
bool LiveServer::send_rest(Reader& reader) {
  while (!reader.unsent.empty()) {
    const ssize_t sent = ::send(reader.socket.get(), reader.unsent.data(), reader.unsent.size(),
                                MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent < 0) return errno == EAGAIN || errno == EINTR;
    reader.unsent.erase(0, static_cast<std::size_t>(sent));
  }
  return true;
}

void LiveServer::tell_newest() {
  std::uint64_t count = 0;
  [[maybe_unused]] const ssize_t done = ::read(wake_.get(), &count, sizeof count);
  std::string line;
  {
    const std::lock_guard lock(mailbox_->mutex);
    line.swap(mailbox_->line);
  }
  if (line.empty()) return;
  line += '\n';
  std::erase_if(readers_, [&line](Reader& reader) {
    // A reader gets lines whole or not at all: while one is on its way, it misses the others.
    if (!reader.unsent.empty()) return ++reader.missed > kMaxMissed;
    reader.missed = 0;
    reader.unsent = line;
    return !send_rest(reader);
  });
}

// Until readers are taken again; -1 when they are.
int LiveServer::poll_timeout_ms() const {
  const Duration left = paused_until_ - io::now();
  return left > Duration::zero() ? static_cast<int>(to_ms(left)) + 1 : -1;
}

void LiveServer::serve() {
  while (!stop_) {
    const int timeout_ms = poll_timeout_ms();
    // poll() passes over a negative descriptor.
    const int listener = timeout_ms < 0 ? listener_.get() : -1;
    std::vector<pollfd> items{{listener, POLLIN, 0}, {wake_.get(), POLLIN, 0}};
    for (const Reader& reader : readers_) {
      const auto events = static_cast<short>(POLLRDHUP | (reader.unsent.empty() ? 0 : POLLOUT));
      items.push_back({reader.socket.get(), events, 0});
    }
    if (::poll(items.data(), items.size(), timeout_ms) < 0) {
      if (errno == EINTR) continue;
      return;
    }
    std::size_t i = 2;
    std::erase_if(readers_, [&items, &i](Reader& reader) {
      const short happened = items[i++].revents;
      return (happened & ~POLLOUT) != 0 || (happened != 0 && !send_rest(reader));
    });
    if (items[1].revents != 0) tell_newest();
    if (items[0].revents != 0) take_reader();
    reader_count_ = static_cast<int>(readers_.size());
  }
}

LiveReader::LiveReader() = default;
LiveReader::~LiveReader() = default;

std::vector<std::string> LiveReader::names() {
  std::vector<std::string> names;
  std::ifstream table("/proc/net/unix");
  for (std::string line; std::getline(table, line);) {
    const std::size_t at = line.rfind(" @");
    if (at == std::string::npos) continue;
    const std::string name = line.substr(at + 2);
    // Connections carry the listener's name too.
    if (name.starts_with(kPrefix) && std::ranges::find(names, name) == names.end()) {
      names.push_back(name);
    }
  }
  std::ranges::sort(names);
  return names;
}

void LiveReader::connect(const std::string& name) {
  const auto where = abstract(name);
  io::FileDescriptor socket = stream_socket();
  if (!where || socket.get() < 0 || connections_.size() >= kMaxPrograms) return;
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&where->address), where->size) !=
      0) {
    return;
  }
  // Root reads the programs of all users, others only their own and root's.
  if (::geteuid() != 0 && !same_user_or_root(socket.get(), 0)) return;
  connections_.push_back({name, std::move(socket), {}, {}});
}

// False when the connection has ended.
bool LiveReader::read(Connection& c) {
  std::array<char, 16 * 1024> chunk;
  // Not for ever, however fast the other end writes.
  for (std::size_t taken = 0; taken < kMaxLineBytes; taken += chunk.size()) {
    const ssize_t n = ::recv(c.socket.get(), chunk.data(), chunk.size(), MSG_DONTWAIT);
    if (n < 0) return errno == EAGAIN || errno == EINTR;
    if (n == 0) return false;
    c.pending.append(chunk.data(), static_cast<std::size_t>(n));
    if (c.pending.size() > kMaxLineBytes) return false;
    const std::size_t end = c.pending.rfind('\n');
    if (end == std::string::npos) continue;
    const std::size_t before = end == 0 ? std::string::npos : c.pending.rfind('\n', end - 1);
    const std::size_t begin = before == std::string::npos ? 0 : before + 1;
    c.newest = c.pending.substr(begin, end - begin);
    c.pending.erase(0, end + 1);
  }
  return true;
}

std::size_t LiveReader::silent() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(connections_, [](const Connection& c) { return c.newest.empty(); }));
}

std::vector<std::string> LiveReader::lines() {
  for (const std::string& name : names()) {
    if (std::ranges::find(connections_, name, &Connection::name) == connections_.end()) {
      connect(name);
    }
  }
  std::erase_if(connections_, [](Connection& c) { return !read(c); });
  std::vector<std::string> lines;
  for (const Connection& c : connections_) {
    if (!c.newest.empty()) lines.push_back(c.newest);
  }
  return lines;
}

}  // namespace interneuron::watch
