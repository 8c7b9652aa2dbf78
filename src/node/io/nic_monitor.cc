#include "node/io/nic_monitor.h"

#include <functional>
#include <map>

#include "node/io/address.h"
#include "node/io/parts.h"

namespace interneuron::io {

namespace {

class FixedNics final : public NicMonitor {
 public:
  int native_handle() const override { return -1; }
  std::vector<NicEvent> update() override { return {}; }
  const std::vector<Nic>& nics() const override { return nics_; }

  NicState state(std::string_view name) const override {
    const auto it = verdicts_.find(name);
    return it == verdicts_.end() ? NicState::kAbsent : it->second.state;
  }
  std::string_view reason(std::string_view name) const override {
    const auto it = verdicts_.find(name);
    if (it == verdicts_.end()) return "there is no network card of this name";
    return it->second.reason;
  }
  void require_route(std::string_view name, const Address& peer) override { judge(name, peer); }
  void require_nothing(std::string_view name) override { judge(name, std::nullopt); }
  std::optional<Address> required_source(std::string_view) const override { return std::nullopt; }
  void drop_unanswered_neighbours(std::string_view) override {}

 private:
  void judge(std::string_view name, const std::optional<Address>& peer) {
    const Nic* nic = find(name);
    if (nic == nullptr) return;
    std::vector<Address> usable;
    std::ranges::copy_if(nic->addresses, std::back_inserter(usable),
                         [&](const Address& address) { return is_usable(address, peer); });
    verdicts_.insert_or_assign(nic->name, judge_card(*nic, usable, peer));
  }

  std::vector<Nic> nics_ = list_nics();
  std::map<std::string, NicVerdict, std::less<>> verdicts_;
};

}  // namespace

std::unique_ptr<NicMonitor> open_nic_monitor() {
  const MonitorPart* part = monitor_part();
  if (part != nullptr) return part->open();
  return std::make_unique<FixedNics>();
}

NicVerdict judge_card(const Nic& nic, std::span<const Address> usable,
                      const std::optional<Address>& peer) {
  if (!nic.admin_up) return {NicState::kNoCarrier, "administratively down"};
  if (!nic.carrier || !nic.up) {
    return {NicState::kNoCarrier,
            nic.carrier ? "no carrier: operational state " + nic.operstate : "no carrier"};
  }
  if (usable.empty()) {
    const bool any = !peer || peer->size == 0;
    return {NicState::kNoAddress, any              ? "no address"
                                  : is_ipv6(*peer) ? "no IPv6 address"
                                                   : "no IPv4 address"};
  }
  return {NicState::kReady, "ready with address " + host_text(usable.front())};
}

// Link-local addresses reach nobody but link-local peers, and appear before the others are there.
bool is_usable(const Address& address, const std::optional<Address>& peer) {
  if (!peer || peer->size == 0) return !is_link_local(address);
  return is_ipv6(address) == is_ipv6(*peer) && (!is_link_local(address) || is_link_local(*peer));
}

}  // namespace interneuron::io
