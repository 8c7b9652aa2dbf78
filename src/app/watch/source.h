// Where the figures of `interneuron links` and `top` come from: with --peer, from a node of their
// own that talks to a roadside unit; else from the programs that run on this host (live_state.h);
// where there are none, from the kernel alone.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "app/settings/key_options.h"
#include "app/watch/row.h"

namespace interneuron::watch {

struct LinkSourceOptions {
  // HOST[:PORT]; empty: the programs on this host.
  std::string peer;
  // Each as --link gives it. Without any, `peer` is reached over every NIC that can be used.
  std::vector<std::string> links;
  // The keys of the node that talks to the peer.
  settings::KeyOptions keys;
};

// Whether the figures are those of a node of our own.
inline bool measures(const LinkSourceOptions& options) {
  return !options.peer.empty() || !options.links.empty();
}
// Adds --peer, --link and the options of keys.
void add_source_options(CLI::App& command, LinkSourceOptions& options);

// Belongs to one thread.
class LinkSource {
 public:
  virtual ~LinkSource() = default;
  // What is known now; does not wait. Throws the error that ended the source.
  virtual LinksSnapshot snapshot() = 0;
  // Whether at the last snapshot() a program ran on this host that had not told of its links yet.
  virtual bool expects_more() const { return false; }
  // Whether anything was received from the peer; true for sources without one.
  virtual bool answered() const { return true; }
  // The peer and the NICs over which it is reached, "10.0.0.1:47000 over if4g, if5g"; empty without
  // a peer.
  virtual std::string peer_text() const { return {}; }
};

// Throws Failure (1 for an unknown host or when no NIC can be used, 2 for a malformed option or one
// without effect, 3 where a key is missing), or what Node throws.
std::unique_ptr<LinkSource> make_link_source(const LinkSourceOptions& options);

}  // namespace interneuron::watch
