// One path to a peer: where it leads, what is believed of it, what is measured on it when nothing
// else is sent. A path is named by the link id of the side that connected; this side may reach
// several paths over one NIC. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <optional>

#include "core/flow/receiver.h"
#include "core/flow/sender.h"
#include "core/link/link_estimator.h"
#include "core/link/probe_schedule.h"
#include "core/wire/packet.h"
#include "interneuron/endpoint.h"

namespace interneuron {

class Path {
 public:
  // What a path must know of the NIC on this side.
  struct Nic {
    LinkId link{};
    std::size_t max_datagram = 0;
    LinkTraits traits{};
  };

  // `trusted`: the peer's address was given to us. Any other gets no more than three times what it
  // has sent, until it has echoed our session (RFC 9000 §8.1).
  Path(TimePoint now, LinkId id, const Nic& nic, const Address& address, bool trusted);
  // The same path over another NIC or to another address. What is known of it stays.
  void move_to(TimePoint now, const Nic& nic, const Address& address, bool trusted);
  // The peer began a new life.
  void reset(TimePoint now);

  LinkId id() const { return id_; }
  const Nic& nic() const { return nic_; }
  const Address& address() const { return address_; }
  bool may_send(std::size_t size) const;
  bool usable() const;  // as far as its traffic shows

  // --- what happened
  void received(std::size_t bytes) { bytes_in_ += bytes; }
  void echoed() { validated_ = true; }  // the peer has heard us on it
  void sent_feedback(TimePoint now, std::size_t bytes);
  void sent_data(TimePoint now, std::size_t bytes);
  void sent_probe(TimePoint now, std::size_t bytes);
  // `verdicts`: on the report, from the sender; `report` is about this path.
  void learn(TimePoint now, const wire::LinkReport& report, const flow::SentPackets::Verdicts& v);
  // An exchange of feedback that came over this path: sent by the peer at `u`, received now.
  void learn_exchange(TimePoint now, PeerTime u, const wire::LinkReport& report);
  // After anything that may have changed what is believed. `ready`: the peer has echoed us.
  void refresh(TimePoint now, bool ready);

  // --- what is due
  // Nothing may be sent before it is asked again.
  bool heartbeat_due(TimePoint now);
  // A full-size probe should leave now, of a train or as proof of delivery.
  bool probe_due(TimePoint now);
  TimePoint next_timeout(TimePoint now) const;

  wire::LinkReport report(TimePoint now) const;
  flow::PathView view(TimePoint now) const;
  LinkState state(TimePoint now) const;

  flow::PathReceiver receiver;
  link::LinkEstimator estimator;
  link::ProbeSchedule probes;

 private:
  void begin(TimePoint now);
  std::optional<DataRate> capped(std::optional<DataRate> rate) const;

  LinkId id_{};
  Nic nic_;
  Address address_;
  bool validated_ = false;
  bool peer_is_metered_ = false;
  std::uint64_t bytes_in_ = 0;
  std::uint64_t bytes_out_ = 0;
  // The train under way.
  std::uint32_t train_left_ = 0;
  std::optional<DataRate> train_pace_;
  TimePoint train_next_{};
};

}  // namespace interneuron
