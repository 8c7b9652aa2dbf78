#include "node/loop/link_set.h"

#include <algorithm>
#include <cerrno>
#include <limits>
#include <system_error>
#include <utility>

#include "node/io/nic_choice.h"

namespace interneuron {

namespace {

// Calls of receive() by which a transport that was set aside gets rid of what waits in it. No
// measurement behind this value: the memory of an AF_XDP socket is empty after 12 (kReceiveChunks
// and kBatch of src/node/xdp/xdp_socket.h), and a flood must not keep us.
constexpr int kStaleBatches = 16;

bool is_privilege(int error) { return error == EPERM || error == EACCES; }

}  // namespace

LinkSet::LinkSet(const NodeOptions& options, User& user)
    : options_(options), user_(user), monitor_(io::open_nic_monitor()) {
  for (const NodeLink& link : options.links) add_named(link);
  for (const NodeNicRule& rule : options.rules) {
    if (!io::is_nic_rule(rule.pattern) && monitor_->find(rule.pattern) == nullptr) {
      throw io::UnknownNic(io::no_match_text(rule.pattern, monitor_->nics()));
    }
  }
  for (const io::Nic& nic : monitor_->nics()) add_by_rule(nic);
  for (const auto& link : links_) {
    if (link->state != NicState::kReady) continue;
    if (!link->by_rule) {
      open(*link);
    } else if (!try_open(*link)) {
      warnings_.push_back(link->options.nic + ": " + link->reason);
    }
  }
  refuse_nothing_open();
  telling_ = true;
}

void LinkSet::add_named(const NodeLink& link) {
  const io::Nic* nic = monitor_->find(link.nic);
  if (nic == nullptr) throw io::UnknownNic(io::no_match_text(link.nic, monitor_->nics()));
  check_link(options_, link, *nic);
  add(link, false);
}

// Makes a link of the NIC if a rule matches it and it is no link yet; else nullptr.
LinkSet::Link* LinkSet::add_by_rule(const io::Nic& nic) {
  if (has_link_on(nic.name)) return nullptr;
  for (const NodeNicRule& rule : options_.rules) {
    if (!io::matches(rule.pattern, nic)) continue;
    const auto id = free_id();
    if (!id) return nullptr;
    return &add({.id = *id, .nic = nic.name, .traits = rule.traits, .peer = rule.peer}, true);
  }
  return nullptr;
}

// Adds a link without opening it. What its NIC must have to be ready, an address or a route to the
// peer, is decided by the first link of the NIC that has a peer.
LinkSet::Link& LinkSet::add(const NodeLink& options, bool by_rule) {
  const auto peer = parse_address(options.peer);
  const bool decided = std::ranges::any_of(links_, [&](const auto& other) {
    return other->options.nic == options.nic && (!peer || !other->options.peer.empty());
  });
  auto& link = *links_.emplace_back(std::make_unique<Link>());
  link.options = options;
  link.by_rule = by_rule;
  if (!decided) monitor_->require_route(options.nic, peer.value_or(Address{}));
  link.state = monitor_->state(options.nic);
  link.reason = monitor_->reason(options.nic);
  return link;
}

std::optional<LinkId> LinkSet::free_id() const {
  for (unsigned id = 0; id <= std::numeric_limits<decltype(LinkId::value)>::max(); ++id) {
    const LinkId candidate{static_cast<decltype(LinkId::value)>(id)};
    if (find(candidate) == nullptr) return candidate;
  }
  return std::nullopt;
}

bool LinkSet::has_link_on(std::string_view nic) const {
  return std::ranges::any_of(links_, [&](const auto& link) { return link->options.nic == nic; });
}

LinkSet::Link* LinkSet::find(LinkId id) const {
  const auto it =
      std::ranges::find_if(links_, [id](const auto& link) { return link->options.id == id; });
  return it == links_.end() ? nullptr : it->get();
}

// Throws when no link could be opened: the caller should learn that the node reaches nobody.
void LinkSet::refuse_nothing_open() const {
  if (std::ranges::any_of(links_, [](const auto& link) { return link->transport != nullptr; })) {
    return;
  }
  if (links_.empty()) {
    throw io::UnknownNic(io::no_match_text(options_.rules.front().pattern, monitor_->nics()));
  }
  std::string text = "no network card can be used: ";
  std::string separator;
  for (const auto& link : links_) {
    text += separator + link->options.nic + ": " + link->reason;
    separator = "; ";
  }
  // Where nothing but a privilege was in the way of all that were ready, that is the remedy.
  bool any_ready = false;
  bool all_refused = true;
  for (const auto& link : links_) {
    if (link->state != NicState::kReady) continue;
    any_ready = true;
    all_refused = all_refused && is_privilege(link->error);
  }
  throw IoError(text, any_ready && all_refused ? EPERM : ENETUNREACH);
}

void LinkSet::open_anew(Link& link, std::vector<std::string>& warnings) {
  const io::Nic* nic = monitor_->find(link.options.nic);
  if (nic == nullptr) throw IoError("there is no such network card", ENODEV);
  OpenedLink opened = open_link(options_, link.options, *nic,
                                {.port = link.port != 0 ? link.port : options_.port,
                                 .source = monitor_->required_source(link.options.nic),
                                 .may_wait = !telling_});
  link.transport = std::move(opened.transport);
  link.siblings = std::move(opened.siblings);
  link.info = std::move(opened.info);
  link.port = port_of(link.transport->local_address());
  warnings = std::move(opened.warnings);
}

void LinkSet::open(Link& link) {
  std::vector<std::string> warnings;
  if (link.aside) {
    link.transport = std::move(link.aside);
    for (int i = 0; i < kStaleBatches && !link.transport->receive().empty(); ++i) continue;
  } else {
    open_anew(link, warnings);
  }
  if (!telling_) {
    warnings_.insert(warnings_.end(), warnings.begin(), warnings.end());
    return;
  }
  user_.link_opened(link);
  for (const std::string& warning : warnings) {
    user_.nic_changed({link.options.id, link.options.nic, link.state, link.state, warning, true});
  }
}

bool LinkSet::try_open(Link& link) {
  link.error = 0;
  try {
    open(link);
    return true;
  } catch (const IoError& error) {
    link.reason = error.what();
    link.error = error.code();
  } catch (const std::exception& error) {
    link.reason = error.what();
  }
  // The socket may be open although the user's link_opened() has thrown.
  close(link);
  return false;
}

std::unique_ptr<Transport> LinkSet::withdraw(Link& link) {
  if (link.transport) user_.link_closing(link);
  link.siblings.clear();
  return std::move(link.transport);
}

void LinkSet::close(Link& link) {
  withdraw(link).reset();
  link.aside.reset();
}

void LinkSet::suspend(Link& link) {
  auto transport = withdraw(link);
  if (transport && options_.transport == TransportKind::kXdp) link.aside = std::move(transport);
}

std::optional<TimePoint> LinkSet::update(TimePoint now) {
  const std::vector<io::NicEvent> events = monitor_->update();
  for (const io::NicEvent& event : events) apply(now, event);
  auto next = open_ready(now);
  if (!events.empty()) next = std::min(next.value_or(TimePoint::max()), now + kRecheck);
  return next;
}

// Opens the links whose NICs are ready and have settled. Returns when the next attempt is due.
std::optional<TimePoint> LinkSet::open_ready(TimePoint now) {
  std::optional<TimePoint> next;
  for (const auto& link : links_) {
    if (link->state != NicState::kReady || link->transport) continue;
    const TimePoint settled = saturating_add(link->carrier_since, kSettle);
    TimePoint again = settled;
    if (settled <= now) {
      monitor_->drop_unanswered_neighbours(link->options.nic);
      const std::string told = link->reason;
      if (try_open(*link)) continue;
      if (link->reason != told) {
        user_.nic_changed(
            {link->options.id, link->options.nic, link->state, link->state, link->reason, true});
      }
      again = now + kRecheck;
    }
    next = std::min(next.value_or(TimePoint::max()), again);
  }
  return next;
}

void LinkSet::apply(TimePoint now, const io::NicEvent& event) {
  if (!event.former_name.empty()) rename(event);
  if (const io::Nic* nic = monitor_->find(event.nic)) {
    if (Link* added = add_by_rule(*nic)) {
      added->carrier_since = now;
      user_.nic_changed(
          {added->options.id, event.nic, NicState::kAbsent, added->state, added->reason});
      return;
    }
  }
  for (const auto& link : links_) {
    if (link->options.nic == event.nic) apply(now, event, *link);
  }
  const auto gone = [&](const auto& link) {
    return link->by_rule && link->options.nic == event.nic && event.to == NicState::kAbsent;
  };
  if (std::erase_if(links_, gone) > 0) monitor_->require_nothing(event.nic);
}

// A socket is bound to the card and not to its name: it goes on, unless it was there by a rule that
// the new name does not match.
void LinkSet::rename(const io::NicEvent& event) {
  const io::Nic* nic = monitor_->find(event.nic);
  const bool matches = nic != nullptr && std::ranges::any_of(options_.rules, [&](const auto& rule) {
                         return io::matches(rule.pattern, *nic);
                       });
  std::erase_if(links_, [&](const auto& link) {
    if (link->options.nic != event.former_name) return false;
    if (!link->by_rule || matches) {
      link->options.nic = event.nic;
      return false;
    }
    close(*link);
    user_.nic_changed({link->options.id, event.former_name, link->state, NicState::kAbsent,
                       "renamed to " + event.nic});
    return true;
  });
  if (!has_link_on(event.nic)) monitor_->require_nothing(event.nic);
}

void LinkSet::apply(TimePoint now, const io::NicEvent& event, Link& link) {
  link.state = event.to;
  link.reason = event.reason;
  if (event.from <= NicState::kNoCarrier && event.to > NicState::kNoCarrier) {
    link.carrier_since = now;
  }
  const io::Nic* nic = monitor_->find(event.nic);
  const Transport* transport = link.transport ? link.transport.get() : link.aside.get();
  const bool fits = nic != nullptr && !event.new_incarnation &&
                    (transport == nullptr ||
                     still_fits(options_, link.options, transport->local_address(), *nic));
  if (!fits) {
    close(link);
  } else if (event.to != NicState::kReady) {
    suspend(link);
  }
  user_.nic_changed({link.options.id, event.nic, event.from, event.to, event.reason});
}

void LinkSet::lost(LinkId id, int error) {
  Link* link = find(id);
  if (link == nullptr || !link->transport) return;
  link->reason = "gone: " + std::generic_category().message(error);
  close(*link);
}

}  // namespace interneuron
