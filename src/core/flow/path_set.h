// Lists and sets of paths to one peer. Pure values; thread-compatible.
#pragma once

#include <algorithm>

#include "interneuron/few.h"
#include "interneuron/link.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Paths in an order, at most kMaxLinks.
using PathList = Few<LinkId, kMaxLinks>;

// Holds at most kMaxLinks paths, more than a peer has (wire::kMaxReports); further ones are left
// out. Or all paths there are, whatever their numbers.
class PathSet {
 public:
  PathSet() = default;
  static PathSet every() {
    PathSet set;
    set.every_ = true;
    return set;
  }
  template <class Paths>
  static PathSet of(const Paths& paths) {
    PathSet set;
    for (const LinkId path : paths) set.add(path);
    return set;
  }
  void add(LinkId path) {
    if (!contains(path)) paths_.push_back(path);
  }
  bool empty() const { return !every_ && paths_.empty(); }
  bool contains(LinkId path) const {
    return every_ || std::find(paths_.begin(), paths_.end(), path) != paths_.end();
  }

 private:
  bool every_ = false;
  PathList paths_;
};

inline const PathSet kEveryPath = PathSet::every();

}  // namespace interneuron::flow
