#include "core/messages/books.h"

#include <algorithm>
#include <cassert>

namespace interneuron::messages {

SendId SentMessages::add(const Entry& entry) {
  const SendId id = next_;
  ++next_.value;
  for (const Variant& v : entry.variants) {
    spare_by_message_.insert(by_message_, {entry.peer, v.message}, id);
  }
  spare_by_end_.insert(by_end_, {entry.ends, id});
  memory_.change(0, 1);
  const auto known = peers_.find(entry.peer);
  if (known == peers_.end()) {
    spare_peers_.insert(peers_, entry.peer, std::size_t{1});
  } else {
    ++known->second;
  }
  spare_entries_.insert(entries_, id, Open{entry, std::nullopt});
  return id;
}

SentMessages::Entries::iterator SentMessages::at(PeerId peer, MessageId message) {
  const auto it = by_message_.find({peer, message});
  return it == by_message_.end() ? entries_.end() : entries_.find(it->second);
}

const SentMessages::Entry* SentMessages::find(SendId id) const {
  const auto it = entries_.find(id);
  return it == entries_.end() ? nullptr : &it->second.entry;
}

const SentMessages::Entry* SentMessages::find(PeerId peer, MessageId message) const {
  const auto it = by_message_.find({peer, message});
  return it == by_message_.end() ? nullptr : find(it->second);
}

std::optional<SendId> SentMessages::id_of(PeerId peer, MessageId message) const {
  const auto it = by_message_.find({peer, message});
  return it == by_message_.end() ? std::nullopt : std::optional(it->second);
}

SentMessages::Variant& SentMessages::variant_of(Open& open, MessageId message) {
  const auto it = std::ranges::find(open.entry.variants, message, &Variant::message);
  assert(it != open.entry.variants.end());
  return *it;
}

MessageFate SentMessages::remove(Entries::iterator it, MessageFate fate) {
  const Entry& entry = it->second.entry;
  fate.id = it->first;
  fate.peer = entry.peer;
  fate.channel = entry.channel;
  for (const Variant& v : entry.variants) {
    spare_by_message_.erase(by_message_, {entry.peer, v.message});
  }
  spare_by_end_.erase(by_end_, {entry.ends, it->first});
  memory_.change(1, 0);
  const auto peer = peers_.find(entry.peer);
  if (--peer->second == 0) spare_peers_.erase(peers_, peer);
  spare_entries_.erase(entries_, it);
  return fate;
}

std::optional<MessageFate> SentMessages::delivered(PeerId peer, MessageId message, When when) {
  const auto it = at(peer, message);
  if (it == entries_.end()) return std::nullopt;
  return remove(it, {.fate = Fate::kDelivered,
                     .variant = variant_of(it->second, message).variant,
                     .age = when.age,
                     .age_error = when.error});
}

std::optional<MessageFate> SentMessages::late(PeerId peer, MessageId message, When when) {
  const auto it = at(peer, message);
  if (it == entries_.end()) return std::nullopt;
  if (!it->second.late) {
    it->second.late = MessageFate{.fate = Fate::kLate,
                                  .variant = variant_of(it->second, message).variant,
                                  .age = when.age,
                                  .age_error = when.error};
  }
  return end_variant(it, message, FateReason::kNone);
}

std::optional<MessageFate> SentMessages::dropped(PeerId peer, MessageId message,
                                                 FateReason reason) {
  const auto it = at(peer, message);
  if (it == entries_.end()) return std::nullopt;
  return end_variant(it, message, reason);
}

std::optional<MessageFate> SentMessages::end_variant(Entries::iterator it, MessageId message,
                                                     FateReason reason) {
  variant_of(it->second, message).over = true;
  if (!std::ranges::all_of(it->second.entry.variants, &Variant::over)) return std::nullopt;
  return end(it->first, Fate::kDropped, reason);
}

std::optional<MessageFate> SentMessages::end(SendId id, Fate fate, FateReason reason) {
  const auto it = entries_.find(id);
  if (it == entries_.end()) return std::nullopt;
  // A variant that was late says more than the others that came not at all; but not where one may
  // have come of which nothing was heard.
  const bool others_did_not_come = fate != Fate::kUnknown && reason != FateReason::kCancelled;
  if (it->second.late && others_did_not_come) return remove(it, *it->second.late);
  return remove(it, {.fate = fate, .reason = reason});
}

std::vector<SendId> SentMessages::to(PeerId peer) const {
  std::vector<SendId> out;
  for (auto it = by_message_.lower_bound({peer, MessageId{}});
       it != by_message_.end() && it->first.first == peer; ++it) {
    out.push_back(it->second);
  }
  std::ranges::sort(out);
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

std::optional<SendId> SentMessages::ended(TimePoint now) const {
  if (by_end_.empty() || by_end_.begin()->first > now) return std::nullopt;
  return by_end_.begin()->second;
}

std::optional<TimePoint> SentMessages::first_end() const {
  if (by_end_.empty()) return std::nullopt;
  return by_end_.begin()->first;
}

}  // namespace interneuron::messages
