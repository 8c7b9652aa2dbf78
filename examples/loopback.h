// What the examples share: nodes of one process that meet on the loopback card, each with a thread
// of its own, and how a round's answer is told.
#pragma once

#include <interneuron/node.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

namespace examples {

namespace in = interneuron;

inline constexpr in::LinkId kFirst{1};
inline constexpr in::LinkId kSecond{2};

// Two links on the loopback card, told apart by their ports, as two radios would be by their names.
inline std::vector<in::NodeLink> two_links() {
  return {{.id = kFirst, .nic = "lo", .local_address = "127.0.0.1"},
          {.id = kSecond, .nic = "lo", .local_address = "127.0.0.1"}};
}

// A node that serves: call start() when its handlers are set; it ends with this object.
class Served {
 public:
  explicit Served(std::vector<in::PipelineConfig> pipelines = {}) : node(options(pipelines)) {}
  ~Served() {
    node.stop();
    if (loop_.joinable()) loop_.join();
  }
  Served(const Served&) = delete;
  Served& operator=(const Served&) = delete;
  void start() {
    loop_ = std::thread([this] { node.run(); });
  }
  std::pair<in::LinkId, in::Address> reached_over(in::LinkId link) const {
    return {link, *node.local_address(link)};
  }

  in::Node node;

 private:
  static in::NodeOptions options(const std::vector<in::PipelineConfig>& pipelines) {
    in::NodeOptions o;
    o.links = two_links();
    o.accept_peers = true;
    o.insecure = true;  // nothing leaves this host; hello.cc has keys
    // A round that passes several nodes comes from one that is not its origin. All are here.
    o.relays = {"127.0.0.1"};
    o.pipelines = pipelines;
    return o;
  }
  std::thread loop_;
};

// Makes `from` talk to `to` over both links; before either runs.
inline in::PeerId connect(in::Node& from, const Served& to) {
  const std::pair<in::LinkId, in::Address> addresses[] = {to.reached_over(kFirst),
                                                          to.reached_over(kSecond)};
  return from.connect(addresses);
}

inline std::string text_of(const in::Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

inline in::Bytes to_bytes(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

inline void print(const char* name, const in::RoundDone& done) {
  const bool remote = done.outcome == in::Outcome::kRemote;
  std::printf("%s %2u: %6.2f ms %-6s %s\n", name, done.round.round.value, in::to_ms(done.e2e),
              remote ? "remote" : "local", text_of(done.result).c_str());
}

// Runs `program` unless --help or something unknown is asked for. Exit code: 0, 2 usage, 1 failed.
template <class Program>
int run(int argc, char** argv, const char* help, std::size_t max_arguments, Program program) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (!arguments.empty() && (arguments[0] == "--help" || arguments[0] == "-h")) {
    std::fputs(help, stdout);
    return 0;
  }
  if (arguments.size() > max_arguments) {
    std::fprintf(stderr, "%s: too many arguments; see --help\n", argv[0]);
    return 2;
  }
  try {
    return program(arguments);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", argv[0], e.what());
    return 1;
  }
}

}  // namespace examples
