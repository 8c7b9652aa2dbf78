#include "core/wire/message_bytes.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace interneuron::wire::message_bytes_test {
namespace {

RC_GTEST_PROP(MessageBytes, PartsMakeUpTheMessage, ()) {
  const auto header = *rc::gen::inRange<std::size_t>(0, MessageBytes::kMostHeaderBytes + 1);
  const auto payload = *rc::gen::inRange<std::size_t>(0, 300);
  const auto chunk = *rc::gen::inRange<std::size_t>(1, 200);
  Bytes all(header + payload);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::byte>(i * 7 + i / 256);
  const ByteView view(all);
  const MessageBytes message(view.first(header),
                             Bytes(all.begin() + static_cast<long>(header), all.end()));
  RC_ASSERT(message.size() == all.size());
  Bytes joined;
  for (std::size_t at = 0; at < all.size(); at += chunk) {
    const MessageBytes::Part part = message.part(at, std::min(chunk, all.size() - at));
    RC_ASSERT(part.size() == std::min(chunk, all.size() - at));
    for (const ByteView bytes : {part.header, part.payload}) {
      joined.insert(joined.end(), bytes.begin(), bytes.end());
    }
  }
  RC_ASSERT(joined == all);
}

}  // namespace
}  // namespace interneuron::wire::message_bytes_test
