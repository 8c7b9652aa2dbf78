// Who is meant by a session or an address.
#include "core/peers/peer_table.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>
#include <set>
#include <vector>

#include "pipe.h"

namespace interneuron::directory_test {
namespace {

using peers::Directory;

std::set<Directory::Slot> peers_of(const Directory& directory, SessionId session) {
  std::set<Directory::Slot> out;
  directory.for_each(session, [&](Directory::Slot peer) { EXPECT_TRUE(out.insert(peer).second); });
  return out;
}

TEST(Directory, SessionZeroIsNobodys) {
  Directory directory(1);
  directory.add_session(SessionId{0}, 3);
  directory.retire(SessionId{0});
  EXPECT_TRUE(peers_of(directory, SessionId{0}).empty());
  EXPECT_FALSE(directory.is_retired(SessionId{0}));
}

TEST(Directory, SeveralPeersMayHaveOneSessionOrOneAddress) {
  Directory directory(1);
  for (const Directory::Slot peer : {1U, 2U}) {
    directory.add_session(SessionId{7}, peer);
    directory.add_address(kFast, address_of(9), peer);
  }
  EXPECT_EQ(peers_of(directory, SessionId{7}), (std::set<Directory::Slot>{1, 2}));
  directory.remove_session(SessionId{7}, 1);
  EXPECT_EQ(peers_of(directory, SessionId{7}), (std::set<Directory::Slot>{2}));
  directory.remove_address(kFast, address_of(9), 2);
  std::vector<Directory::Slot> at;
  directory.for_each(kFast, address_of(9), [&](Directory::Slot peer) { at.push_back(peer); });
  EXPECT_EQ(at, std::vector<Directory::Slot>{1});
  directory.for_each(kSlow, address_of(9), [](Directory::Slot) { ADD_FAILURE(); });
}

TEST(Directory, TheOldestRetiredSessionIsForgotten) {
  Directory directory(1);
  for (std::uint32_t s = 1; s <= Directory::kRetired + 1; ++s) directory.retire(SessionId{s});
  EXPECT_FALSE(directory.is_retired(SessionId{1}));
  EXPECT_TRUE(directory.is_retired(SessionId{2}));
  EXPECT_TRUE(directory.is_retired(SessionId{Directory::kRetired + 1}));
}

RC_GTEST_PROP(Directory, DoesWhatAMapDoes, (std::uint64_t seed)) {
  Directory directory(seed);
  std::map<std::uint32_t, std::set<Directory::Slot>> model;
  const int steps = *rc::gen::inRange(0, 200);
  for (int i = 0; i < steps; ++i) {
    const auto session = *rc::gen::inRange<std::uint32_t>(1, 8) << 20U;
    const auto peer = *rc::gen::inRange<Directory::Slot>(0, 8);
    if (model[session].insert(peer).second) {
      directory.add_session(SessionId{session}, peer);
    } else {
      model[session].erase(peer);
      directory.remove_session(SessionId{session}, peer);
    }
    RC_ASSERT(peers_of(directory, SessionId{session}) == model[session]);
  }
}

}  // namespace
}  // namespace interneuron::directory_test
