// The bytes of a message are not copied between the cutting of its pieces and the transport,
// neither in the clear nor encrypted: whatever the program copies in that time is counted, by what
// the linker puts in the place of memcpy() and memmove().
#include <gtest/gtest.h>

#include <set>

#include "lab/sim/trust.h"
#include "node/loop/outbox.h"
#include "tests/core/endpoint/pipe.h"

extern "C" {
void* __real_memcpy(void* to, const void* from, std::size_t size);
void* __real_memmove(void* to, const void* from, std::size_t size);
void* __wrap_memcpy(void* to, const void* from, std::size_t size);
void* __wrap_memmove(void* to, const void* from, std::size_t size);
}

namespace interneuron::copies_test {
namespace {

// Places whose bytes are watched, and how many of their bytes were copied while this lived. One at
// a time, on one thread.
class Watch {
 public:
  Watch() { active_ = this; }
  ~Watch() { active_ = nullptr; }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  void add(ByteView place) {
    if (count_ < places_.size()) places_[count_++] = place;
  }
  std::size_t copied() const { return copied_; }

  static void note(const void* from, std::size_t size) {
    if (active_ == nullptr) return;
    const auto begin = reinterpret_cast<std::uintptr_t>(from);
    for (std::size_t i = 0; i < active_->count_; ++i) {
      const ByteView place = active_->places_[i];
      const auto first = std::max(begin, reinterpret_cast<std::uintptr_t>(place.data()));
      const auto last =
          std::min(begin + size, reinterpret_cast<std::uintptr_t>(place.data()) + place.size());
      if (last > first) active_->copied_ += last - first;
    }
  }

 private:
  static inline thread_local Watch* active_ = nullptr;
  std::array<ByteView, kQueueDatagrams> places_;
  std::size_t count_ = 0;
  std::size_t copied_ = 0;
};

// A program of a sanitizer copies by functions of its own.
bool sees_copies(ByteView bytes) {
  Bytes copy(bytes.size());
  Watch watch;
  watch.add(bytes);
  std::ranges::copy(bytes, copy.begin());
  return watch.copied() == bytes.size();
}

// An endpoint as Node shows it to its outbox. Every payload, and every packet that was made of one,
// is watched from the moment on at which the endpoint gives it.
class Watched final : public Outbox::Source {
 public:
  Watched(Endpoint& endpoint, Watch& watch) : endpoint_(endpoint), watch_(watch) {}
  std::optional<TransmitParts> poll(TimePoint now, std::span<std::byte> buffer) override {
    const auto parts = endpoint_.poll_transmit_parts(now, buffer);
    if (parts && parts->size() > kPiece)
      watch_.add(parts->payload.empty() ? buffer : parts->payload);
    return parts;
  }
  static constexpr std::size_t kPiece = 1000;

 private:
  Endpoint& endpoint_;
  Watch& watch_;
};

class Taker final : public Transport {
 public:
  BatchResult send(std::span<const Outgoing> batch) override {
    for (const Outgoing& datagram : batch) bytes += datagram.size();
    BatchResult result;
    result.taken = batch.size();
    return result;
  }
  std::span<const Incoming> receive() override { return {}; }
  TransportCaps capabilities() const override { return {}; }
  TransportCounters counters() const override { return {}; }
  Address local_address() const override { return {}; }
  int native_handle() const override { return -1; }

  std::size_t bytes = 0;
};

void expect_no_copies(bool encrypted) {
  constexpr std::size_t kBytes = 40'000;
  Pipe pipe;
  EndpointOptions vehicle = options_of(1, {}, false);
  EndpointOptions road = options_of(2);
  if (encrypted) {
    vehicle.security = security_of(1, {2});
    road.security = security_of(2, {1});
  }
  const std::size_t from = pipe.add_host(vehicle);
  const PeerId peer = pipe.connect(from, pipe.add_host(road));
  pipe.run(1s);

  Variants variants;
  variants.emplace_back(kBytes);
  const ByteView payload = variants.front();
  if (!sees_copies(payload)) GTEST_SKIP() << "this build copies by functions that are not counted";
  Watch watch;
  watch.add(payload);
  Taker transport;
  Outbox outbox;
  for (const LinkId link : {kFast, kSlow}) outbox.add(link, transport);
  Watched source(pipe.at(from), watch);
  pipe.at(from).send(pipe.local(from), peer, std::move(variants), {.deadline = 1s});
  for (TimePoint now = pipe.local(from); transport.bytes < kBytes; now += 1ms) {
    ASSERT_LT(now, pipe.local(from) + 100ms);
    outbox.pump(now, source);
  }
  EXPECT_EQ(watch.copied(), 0U);
}

TEST(Copies, NoneOfAPayloadInTheClear) { expect_no_copies(false); }

TEST(Copies, NoneOfAPayloadThatIsEncrypted) { expect_no_copies(true); }

}  // namespace
}  // namespace interneuron::copies_test

void* __wrap_memcpy(void* to, const void* from, std::size_t size) {
  interneuron::Watch::note(from, size);
  return __real_memcpy(to, from, size);
}

void* __wrap_memmove(void* to, const void* from, std::size_t size) {
  interneuron::Watch::note(from, size);
  return __real_memmove(to, from, size);
}
