// One path to a peer: where it leads, what is believed of it, how much may be sent on it, and which
// packets that carry no message are due on it. A path is named by the link id of the side that
// connected; this side may reach several paths over one NIC.
//
// Path decides when a packet may and should leave, and Peer writes and sends it. What is worth
// measuring is decided by link::ProbeSchedule; Path spaces the packets of a train that was decided
// on, because that needs the size of datagrams and the operator's rate cap, which it alone knows.
//
// The peer's reports are not trusted: the estimators bound what they say. Its address was given to
// us or is proved (AddressValidation), so that nobody is sent what another one has asked for.
// Copies of feedback take a small share of what messages have brought in (may_copy()), so a peer
// that sends much gets little more. Constant memory. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "core/cc/share_control.h"
#include "core/flow/arrivals.h"
#include "core/flow/sender.h"
#include "core/link/link_estimator.h"
#include "core/link/path_ecn.h"
#include "core/link/path_mtu.h"
#include "core/link/probe_schedule.h"
#include "core/wire/packet.h"
#include "interneuron/endpoint.h"

namespace interneuron::peers {

class Path {
 public:
  // What a path must know of the NIC on this side.
  struct Nic {
    LinkId link{};
    // The largest UDP payload it carries, in bytes.
    std::size_t max_datagram = 0;
    LinkTraits traits{};
  };

  struct Origin {
    // We have asked for this peer. Where it has asked for us, it measures first: nothing is sent to
    // measure a path before the peer has told of it, and with that whether it pays for the bytes.
    bool connected = false;
    // Differs from path to path and from one endpoint to the next.
    std::uint64_t seed = 0;
  };
  Path(TimePoint now, LinkId id, const Nic& nic, const Address& address, const Origin& origin);
  // The same path over another NIC or to another address. What was learnt of it stays.
  void move_to(TimePoint now, const Nic& nic, const Address& address);
  // The peer has begun a new session: nothing that was learnt stays.
  void reset(TimePoint now);

  LinkId id() const { return id_; }
  const Nic& nic() const { return nic_; }
  const Address& address() const { return address_; }
  // The largest UDP payload that a message may use, in bytes.
  std::size_t datagram() const { return mtu_.datagram(); }
  // The ECN bits of what is data-sized.
  std::uint8_t ecn_bits() const { return ecn_.bits(); }
  // The rate from here and from the peer, if what upkeep takes of it is to be limited by it
  // (src/core/base/slow_link.h); zero: it is not. Where bytes are paid for, the rate is that of the
  // messages that happened to be sent.
  DataRate slow_rate() const;
  DataRate peer_slow_rate() const;
  // Whether messages may be sent on it, as far as its traffic shows.
  bool usable() const;

  // --- what happened
  // A part of a message of the peer's, with its IP header.
  void received_message(TimePoint now, std::size_t ip_bytes);
  void sent_feedback(TimePoint now);
  // Beside sent_feedback(), where it was a copy of what another path has told, with its IP header.
  void sent_copy(std::size_t ip_bytes) { copy_credit_ -= static_cast<double>(ip_bytes); }
  void sent_data(TimePoint now, std::size_t ip_bytes);
  void sent_probe(TimePoint now, std::uint64_t number);
  // See Paths::asked().
  void asked(TimePoint now, std::span<const std::size_t> sizes, Duration deadline) {
    share_.asked(now, wire_size(sizes.front()), wire_size(sizes.back()), deadline,
                 estimator.rtt_min(now));
  }
  void sent_mtu_probe(TimePoint now, std::uint64_t number);
  // The peer's report about this path, what the sender has concluded from it, and how the path was
  // used since the report before.
  void learn(TimePoint now, const wire::LinkReport& report, const flow::SentPackets::Verdicts& v,
             const flow::PathUse::Told& use);
  // The peer's clock stepped.
  void clock_stepped();
  // An exchange of clocks in feedback that came over this path now and that the peer sent at `u`.
  void learn_exchange(TimePoint now, PeerTime u, const wire::LinkReport& report);
  // Tells the schedule of probes what is believed now. Call it after anything that may have changed
  // that. `ready`: the peer has echoed our session on some path. `needed`: see
  // link::ProbeSchedule::set_needed(). `peer_spacing`: see Paths::peer_feedback_spacing().
  void refresh(TimePoint now, bool ready, DataRate needed, Duration peer_spacing = {});

  // --- addresses
  // A packet of the peer came from another address. Whether that may be challenged: not so soon
  // again, since many packets come before the first challenge is answered.
  bool may_challenge(TimePoint now);
  // The peer wants to see this token before it believes our address.
  void challenged(const wire::Token& token) { token_ = token; }
  // The token that is owed; none after this call.
  std::optional<wire::Token> take_token() { return std::exchange(token_, std::nullopt); }

  // --- what is due
  // Whether a heartbeat is due; send it before the next call.
  bool heartbeat_due(TimePoint now) const { return probes.heartbeat_due(now); }
  // Whether a copy of feedback that leaves over another path, of so many bytes with its IP header,
  // may go over this one: where messages arrive, nobody pays for bytes, and it is neither slow nor
  // a backup.
  bool may_copy(std::size_t ip_bytes) const;
  // Whether a data-sized probe is due, be it of a train or to prove that the path delivers; send it
  // before the next call.
  bool probe_due(TimePoint now);
  // The size of the probe of the path's MTU that is due.
  std::optional<std::size_t> mtu_probe_due() const;
  // Call it at next_timeout().
  void handle_timeout(TimePoint now) { mtu_.handle_timeout(now); }
  TimePoint next_timeout(TimePoint now) const;

  // The part of feedback that is about this path.
  wire::LinkReport report(TimePoint now) const;
  // What the sender must know of the path.
  flow::PathView view(TimePoint now) const;
  // What policies and people see of the path.
  LinkState state(TimePoint now) const;

  flow::PathReceiver receiver;
  link::LinkEstimator estimator;
  link::ProbeSchedule probes;

 private:
  void begin(TimePoint now);
  void control(TimePoint now, const wire::LinkReport& report, const flow::SentPackets::Verdicts& v,
               const flow::PathUse::Told& use);
  // Bytes cost one of the two sides something.
  bool is_paid() const { return nic_.traits.metered || peer_is_metered_; }
  std::size_t window() const;
  code::Losses losses() const;
  std::optional<DataRate> capped(std::optional<DataRate> rate) const;

  LinkId id_{};
  std::uint64_t seed_ = 0;
  cc::ShareControl share_;
  link::PathMtu mtu_;
  link::PathEcn ecn_;
  Nic nic_;
  Address address_;
  // We have asked for the peer, or it has told of this path.
  bool may_measure_ = false;
  bool peer_is_metered_ = false;
  std::optional<wire::Token> token_;
  TimePoint challenge_at_ = TimePoint::min();
  // Bytes that copies of feedback may take, and when messages last brought some.
  double copy_credit_ = 0;
  std::optional<TimePoint> credited_at_;
  // A message was sent on it.
  bool used_ = false;
  // The train under way: how many packets are left of it, how fast they leave (nothing: back to
  // back), when the next one may, and the number of the newest.
  struct Train {
    std::uint32_t left = 0;
    std::optional<DataRate> pace;
    TimePoint next{};
    std::uint64_t newest = 0;
  };
  Train train_;
};

}  // namespace interneuron::peers
