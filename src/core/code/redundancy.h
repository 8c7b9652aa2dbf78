// How many repair symbols are worth sending with pieces that nobody can ask for again.
//
// What can still be reported lost and sent again in time needs none: the last step of a dynamic
// programme over the rounds that are left ("Hairpin: Rethinking Packet Loss Recovery in Edge-based
// Interactive Video Streaming", NSDI 2024) alone sends more than was asked for, because only what
// is lost then is lost for good; tests/core/code/redundancy_test.cc has the whole programme. So the
// sender counts what is in its last round, and asks here.
//
// Losses come in bursts. Their length is some number of packets and beyond that geometric, so that
// both bursts of Gilbert's model, whose deviation is about their mean, and bursts that are all
// alike are what they are. Pure functions without state; no errors.
#pragma once

#include <cstddef>

namespace interneuron::code {

// What is known of the losses of a path.
struct Losses {
  // The share of packets that are lost, in [0, 1].
  double share = 0;
  // Mean number of packets lost in a row; below 1 counts as 1.
  double burst = 1;
  // How much that varies (standard deviation); negative: not known, then geometric.
  double deviation = -1;
};

// The probability that more than `spare` of so many packets in a row are lost.
double chance_of_more(std::size_t packets, std::size_t spare, const Losses& losses);

// How many more symbols, at most `most`, make the probability of losing too many plus what these
// symbols cost least, when so many packets are in their last round and `spare` of them may be lost.
// `price`: of one symbol, as a share of what a lost message costs.
std::size_t symbols_for(std::size_t packets, std::size_t spare, const Losses& losses, double price,
                        std::size_t most);

}  // namespace interneuron::code
