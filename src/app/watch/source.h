// Where the figures of `interneuron links` and `top` come from: a node of their own that talks to a
// roadside unit (--peer), the programs that run on this host, or, with neither, the kernel alone.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "app/watch/row.h"

namespace interneuron::cli {

struct LinkSourceOptions {
  std::string peer;                // HOST[:PORT]; empty: what runs on this host
  std::vector<std::string> links;  // as --link gives them; replaces `peer` over every usable NIC
};

// Belongs to one thread.
class LinkSource {
 public:
  virtual ~LinkSource() = default;
  // What is known now; does not wait. Throws what ended the source.
  virtual LinksSnapshot snapshot() = 0;
  // Whether a program on this host is there that has not told its links yet; as of snapshot().
  virtual bool expects_more() const { return false; }
  // Whether the peer was heard; true for sources without one.
  virtual bool answered() const { return true; }
  // The peer as it is reached, "10.0.0.1:47000 over if4g, if5g"; empty without one.
  virtual std::string peer_text() const { return {}; }
};

// Throws Failure (1 no such host or no usable NIC, 2 malformed) or what Node throws.
std::unique_ptr<LinkSource> make_link_source(const LinkSourceOptions& options);

}  // namespace interneuron::cli
