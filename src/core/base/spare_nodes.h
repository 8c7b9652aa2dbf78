// Nodes that were taken out of a std::map or std::set, for what is added next: nothing is allocated
// while there is no more in it than before.
//
// Keeps as many nodes as the tree has had at a time, until it is destroyed; what their values own
// is kept too. Thread-compatible; pure.
#pragma once

#include <utility>
#include <vector>

namespace interneuron {

template <class Tree>
class SpareNodes {
 public:
  using Key = typename Tree::key_type;

  // Adds a key that is not there yet to a set; its place there.
  typename Tree::iterator insert(Tree& tree, const Key& key) {
    if (spare_.empty()) return tree.insert(key).first;
    auto node = take();
    node.value() = key;
    return tree.insert(std::move(node)).position;
  }
  // The same to a map.
  template <class Value>
  void insert(Tree& tree, const Key& key, Value&& value) {
    if (spare_.empty()) {
      tree.emplace(key, std::forward<Value>(value));
      return;
    }
    auto node = take();
    node.key() = key;
    node.mapped() = std::forward<Value>(value);
    tree.insert(std::move(node));
  }

  void erase(Tree& tree, typename Tree::const_iterator it) { spare_.push_back(tree.extract(it)); }
  // Does nothing where the key is not there.
  void erase(Tree& tree, const Key& key) {
    const auto it = tree.find(key);
    if (it != tree.end()) erase(tree, it);
  }

 private:
  typename Tree::node_type take() {
    auto node = std::move(spare_.back());
    spare_.pop_back();
    return node;
  }

  std::vector<typename Tree::node_type> spare_;
};

}  // namespace interneuron
