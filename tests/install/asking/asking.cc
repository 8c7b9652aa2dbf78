// Opens a node on the loopback card with the transport that is named and says why it cannot.
#include <interneuron/node.h>

#include <cstdio>

namespace in = interneuron;

int main(int, char** argv) {
  in::NodeOptions options;
  options.links = {{.id = {1}, .nic = "lo", .local_address = "127.0.0.1"}};
  options.accept_peers = true;
  options.insecure = true;
  options.transport = *in::parse_transport_kind(argv[1]);
  try {
    const in::Node node(options);
  } catch (const in::IoError& error) {
    std::puts(error.what());
  }
}
