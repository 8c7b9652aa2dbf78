// The bytes of a message are not copied between the cutting of its pieces and the transport,
// neither in the clear nor encrypted: whatever the program copies in that time is counted, by what
// the linker puts in the place of memcpy() and memmove().
#include <gtest/gtest.h>

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
    Watch* const active = active_;
    if (active == nullptr) return;
    const auto begin = reinterpret_cast<std::uintptr_t>(from);
    for (std::size_t i = 0; i < active->count_; ++i) {
      const ByteView place = active->places_[i];
      const auto first = std::max(begin, reinterpret_cast<std::uintptr_t>(place.data()));
      const auto last =
          std::min(begin + size, reinterpret_cast<std::uintptr_t>(place.data()) + place.size());
      if (last > first) active->copied_ = active->copied_ + (last - first);
    }
  }

 private:
  // Volatile, since compilers believe that memcpy() reads and changes nothing but what it copies.
  static inline thread_local Watch* volatile active_ = nullptr;
  std::array<ByteView, kQueueDatagrams> places_;
  std::size_t count_ = 0;
  volatile std::size_t copied_ = 0;
};

// An endpoint as Node shows it to its outbox. Every payload, and every packet that was made of one,
// is watched from the moment on at which the endpoint gives it.
class Watched final : public Outbox::Source {
 public:
  Watched(Endpoint& endpoint, Watch& watch, bool joins)
      : endpoint_(endpoint), watch_(watch), joins_(joins) {}
  std::optional<TransmitParts> poll(TimePoint now, std::span<std::byte> buffer) override {
    const auto parts = endpoint_.poll_transmit_parts(now, buffer);
    if (parts && parts->size() > kPiece)
      watch_.add(parts->payload.empty() ? buffer : parts->payload);
    if (parts && joins_) parts->join(buffer);
    return parts;
  }
  static constexpr std::size_t kPiece = 1000;

 private:
  Endpoint& endpoint_;
  Watch& watch_;
  // Copies each payload into its packet.
  bool joins_;
};

class Taker final : public Transport {
 public:
  BatchResult send(std::span<const Outgoing> batch) override {
    for (const Outgoing& datagram : batch) bytes += datagram.size();
    return BatchResult{.taken = batch.size()};
  }
  std::span<const Incoming> receive() override { return {}; }
  TransportCaps capabilities() const override { return {}; }
  TransportCounters counters() const override { return {}; }
  Address local_address() const override { return {}; }
  int native_handle() const override { return -1; }

  std::size_t bytes = 0;
};

constexpr std::size_t kBytes = 4'000;
// So much of it may leave at once at least: two packets.
constexpr std::size_t kAtOnce = 2'800;

// How many bytes of a message are copied on their way to a transport.
std::size_t copied(bool encrypted, bool joins) {
  Pipe pipe;
  EndpointOptions vehicle = options_of(1, {}, false);
  EndpointOptions road = options_of(2);
  if (encrypted) {
    vehicle.security = sim::security_of(1, {2});
    road.security = sim::security_of(2, {1});
  }
  const std::size_t from = pipe.add_host(vehicle);
  const PeerId peer = pipe.connect(from, pipe.add_host(road));
  pipe.run(1s);

  Variants variants;
  variants.emplace_back(kBytes);
  const ByteView payload = variants.front();
  Watch watch;
  watch.add(payload);
  Taker transport;
  Outbox outbox;
  for (const LinkId link : {kFast, kSlow}) outbox.add(link, transport);
  Watched source(pipe.at(from), watch, joins);
  pipe.at(from).send(pipe.local(from), peer, std::move(variants), {.deadline = 1s});
  for (TimePoint now = pipe.local(from);
       transport.bytes < kAtOnce && now < pipe.local(from) + 100ms; now += 1ms) {
    outbox.pump(now, source);
  }
  EXPECT_GE(transport.bytes, kAtOnce);
  return watch.copied();
}

TEST(Copies, NoneOfAPayloadInTheClear) { EXPECT_EQ(copied(false, false), 0U); }

TEST(Copies, NoneOfAPayloadThatIsEncrypted) { EXPECT_EQ(copied(true, false), 0U); }

TEST(Copies, WhoJoinsThePartsIsCounted) {
  const std::size_t bytes = copied(false, true);
  if (bytes == 0) GTEST_SKIP() << "a sanitizer copies by functions of its own";
  EXPECT_GE(bytes, kAtOnce * 9 / 10);
}

}  // namespace
}  // namespace interneuron::copies_test

void* __wrap_memcpy(void* to, const void* from, std::size_t size) {
  interneuron::copies_test::Watch::note(from, size);
  return __real_memcpy(to, from, size);
}

void* __wrap_memmove(void* to, const void* from, std::size_t size) {
  interneuron::copies_test::Watch::note(from, size);
  return __real_memmove(to, from, size);
}
