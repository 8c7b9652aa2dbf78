// What every transport of a NIC does alike with datagrams, each combination of sender and receiver
// over a link between two network namespaces.
#include "transport_conformance.h"

namespace interneuron::io::transport_conformance_test {
namespace {

class TransportDelivery : public TransportConformance {};

TEST_P(TransportDelivery, EverySizeArrives) {
  for (const bool ipv6 : {false, true}) {
    run(
        [&](Pair& pair) {
          // What fits into an MTU of 1500.
          const std::size_t most = ipv6 ? 1452 : 1472;
          std::vector<Bytes> payloads;
          for (std::size_t size = 1; size <= most; size += size < 40 || size > most - 8 ? 1 : 7) {
            payloads.push_back(payload(size, size));
          }
          payloads.push_back(payload(0, most));
          ASSERT_TRUE(send_all(*pair.here, pair.to_there, payloads));
          EXPECT_EQ(receive_all(*pair.there, payloads.size()), payloads);
          EXPECT_EQ(pair.here->counters().send_errors, 0U);
          EXPECT_EQ(pair.there->counters().receive_errors, 0U);
          // One byte more is dropped and counted, alone among others.
          const std::vector<Bytes> large = {payload(1, 9), payload(2, most + 1), payload(3, 9)};
          ASSERT_TRUE(send_all(*pair.here, pair.to_there, large));
          EXPECT_EQ(receive_all(*pair.there, 2), (std::vector<Bytes>{large[0], large[2]}));
          EXPECT_EQ(pair.here->counters().send_errors, 1U);
          EXPECT_EQ(pair.here->counters().last_send_error, EMSGSIZE);
        },
        ipv6);
  }
}

TEST_P(TransportDelivery, BatchesArriveOnceAndInOrder) {
  for (const bool ipv6 : {false, true}) {
    run(
        [&](Pair& pair) {
          std::vector<Bytes> sent;
          std::vector<Bytes> got;
          for (std::size_t turn = 0; turn < 20; ++turn) {
            std::vector<Bytes> batch;
            for (std::size_t i = 0; i < 200; ++i) {
              // Runs of equal ones with a shorter last, and mixed ones.
              batch.push_back(payload(
                  turn * 200 + i, turn % 2 == 0 ? (i % 40 == 39 ? 77 : 1200) : 100 + i * 13 % 900));
            }
            ASSERT_TRUE(send_all(*pair.here, pair.to_there, batch));
            for (Bytes& bytes : receive_all(*pair.there, batch.size())) got.push_back(bytes);
            sent.insert(sent.end(), batch.begin(), batch.end());
          }
          EXPECT_TRUE(got == sent) << got.size() << " of " << sent.size();
          EXPECT_EQ(pair.here->counters().sent_datagrams, sent.size());
          EXPECT_EQ(pair.there->counters().received_datagrams, sent.size());
          EXPECT_EQ(pair.here->counters().offload_refused, 0U);
          // Runs leave in one call, which the kernel or the NIC segments.
          EXPECT_LT(pair.here->counters().send_calls, sent.size() / 4);
        },
        ipv6);
  }
}

TEST_P(TransportDelivery, PartsArriveAsOneDatagram) {
  run([](Pair& pair) {
    std::vector<Bytes> whole;
    std::vector<Outgoing> batch;
    for (std::size_t i = 0; i < 300; ++i) whole.push_back(payload(i, i % 50 == 49 ? 61 : 301));
    for (std::size_t i = 0; i < whole.size(); ++i) {
      const ByteView bytes(whole[i]);
      const std::size_t head = i % 3 == 0 ? 1 : 37;
      const std::size_t tail = i % 5 == 0 ? 0 : 15;
      batch.push_back({.to = pair.to_there,
                       .head = bytes.first(head),
                       .payload = bytes.subspan(head, bytes.size() - head - tail),
                       .tail = bytes.last(tail)});
    }
    // No more at a time than the queue of a virtual NIC holds that XDP receives from.
    constexpr std::size_t kAtOnce = 150;
    std::vector<Bytes> got;
    for (std::size_t i = 0; i < batch.size(); i += kAtOnce) {
      ASSERT_TRUE(send_all(*pair.here, std::span(batch).subspan(i, kAtOnce)));
      for (Bytes& bytes : receive_all(*pair.there, kAtOnce)) got.push_back(std::move(bytes));
    }
    EXPECT_EQ(got, whole);
  });
}

TEST_P(TransportDelivery, FromIsWhereAnAnswerGoes) {
  for (const bool ipv6 : {false, true}) {
    run(
        [](Pair& pair) {
          ASSERT_TRUE(send_all(*pair.here, pair.to_there, {payload(1, 50)}));
          ASSERT_TRUE(wait_for(*pair.there, POLLIN));
          const auto got = pair.there->receive();
          ASSERT_EQ(got.size(), 1U);
          EXPECT_EQ(to_string(got[0].from), to_string(pair.to_here));
          EXPECT_EQ(got[0].from, pair.to_here);
          ASSERT_TRUE(send_all(*pair.there, got[0].from, {payload(2, 60)}));
          EXPECT_EQ(receive_all(*pair.here, 1), std::vector<Bytes>{payload(2, 60)});
        },
        ipv6);
  }
}

TEST_P(TransportDelivery, AnswersLeaveFromTheAddressThatWasAsked) {
  run_alone([] {
    Pair pair;
    if (!pair.open(GetParam())) GTEST_SKIP();
    pair.there.reset();
    pair.there = pair.hosts.there([] {
      UdpOptions any = TwoHosts::options("vb", "0.0.0.0");
      any.answer_from_receiver = true;
      return make(std::get<1>(GetParam()), any);
    });
    const std::uint16_t port = port_of(pair.there->local_address());
    // The one without a route of its own is a neighbour too, since the sender is on the NIC.
    for (const char* host : {"10.99.0.3", "10.99.0.2", "10.99.0.3"}) {
      const Address asked = *make_address(host, port);
      ASSERT_TRUE(send_all(*pair.here, asked, {payload(1, 50), payload(2, 50)}));
      const std::vector<Address> from = senders(*pair.there, 2);
      for (const Address& address : from) EXPECT_EQ(to_string(address), to_string(pair.to_here));
      ASSERT_TRUE(send_all(*pair.there, from.back(), {payload(3, 50)}));
      EXPECT_EQ(to_string(senders(*pair.here, 1).front()), to_string(asked));
    }
  });
}

TEST_P(TransportDelivery, EcnBitsTravelWithTheirDatagrams) {
  for (const bool ipv6 : {false, true}) {
    run(
        [](Pair& pair) {
          std::vector<Bytes> payloads;
          std::vector<Outgoing> batch;
          for (std::size_t i = 0; i < 40; ++i) payloads.push_back(payload(i, 200));
          const auto there_and_back = [&](Transport& from, Transport& to, const Address& address) {
            batch.clear();
            for (std::size_t i = 0; i < payloads.size(); ++i) {
              batch.push_back(
                  {.to = address, .head = payloads[i], .ecn = static_cast<std::uint8_t>(i / 10)});
            }
            ASSERT_TRUE(send_all(from, batch));
            std::size_t count = 0;
            while (count < batch.size() && wait_for(to, POLLIN)) {
              for (const Incoming& datagram : to.receive()) {
                ASSERT_LT(count, batch.size());
                EXPECT_EQ(datagram.ecn, batch[count].ecn) << count;
                ++count;
              }
            }
            EXPECT_EQ(count, batch.size());
          };
          there_and_back(*pair.here, *pair.there, pair.to_there);
          there_and_back(*pair.there, *pair.here, pair.to_here);
        },
        ipv6);
  }
}

TEST_P(TransportDelivery, TellsWhenTheKernelReceived) {
  run([](Pair& pair) {
    const Duration slack = std::chrono::milliseconds(1);
    const TimePoint end = now() + kPatience;
    // The kernel begins to stamp what arrives some time after it was asked to; until then it says
    // when a datagram was read.
    for (bool is_stamped = false; !is_stamped;) {
      ASSERT_LT(now(), end);
      const TimePoint before = now() - slack;
      ASSERT_TRUE(send_all(*pair.here, pair.to_there, {payload(0, 100)}));
      const TimePoint sent = now() + slack;
      ASSERT_TRUE(wait_for(*pair.there, POLLIN));
      // It is read so late that both times differ.
      while (now() <= sent) continue;
      const auto batch = pair.there->receive();
      ASSERT_EQ(batch.size(), 1U);
      EXPECT_GE(batch[0].at, before);
      is_stamped = batch[0].at <= sent;
    }
  });
}

INSTANTIATE_TEST_SUITE_P(All, TransportDelivery, all_kinds(),
                         [](const auto& test) { return name_of(test.param); });

}  // namespace
}  // namespace interneuron::io::transport_conformance_test
