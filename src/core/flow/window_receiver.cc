// WindowReceiver: computes lost pieces of small messages from window symbols.
#include "core/flow/windows.h"

#include <algorithm>
#include <functional>

#include "core/code/field.h"
#include "core/wire/source.h"

namespace interneuron::flow {

const WindowReceiver::Source* WindowReceiver::find(const Name& name) const {
  const auto it = std::ranges::find(sources_, name, &Source::name);
  return it == sources_.end() ? nullptr : &*it;
}

void WindowReceiver::keep(const Name& name, ByteView head, ByteView bytes) {
  if (sources_.size() < kMostKept) {
    sources_.emplace_back();
    next_source_ = sources_.size() - 1;
  }
  Source& place = sources_[next_source_];
  next_source_ = (next_source_ + 1) % kMostKept;
  place.name = name;
  place.bytes.assign(head.begin(), head.end());
  place.bytes.insert(place.bytes.end(), bytes.begin(), bytes.end());
}

void WindowReceiver::piece(const wire::Data& data) {
  const wire::FragmentHeader& f = data.fragment;
  if (!idle_at_ || f.is_repair() || f.count() > wire::kMostWindowPieces) return;
  const Name name{f.message, static_cast<std::uint8_t>(f.index)};
  if (data.bytes.size() > code::kMostBytes || find(name) != nullptr) return;
  keep(name, wire::source_header(f), data.bytes);
  if (!take_off(name, find(name)->bytes)) return;
  while (solve()) {
  }
}

bool WindowReceiver::take_off(const Name& name, ByteView source) {
  bool any = false;
  for (Equation& e : equations_) {
    const auto unknown = std::ranges::find(e.unknown, name, &Unknown::name);
    if (unknown == e.unknown.end()) continue;
    any = true;
    // No symbol is shorter than what it covers.
    if (source.size() > e.bytes.size()) {
      e.unknown = {};
      continue;
    }
    code::add_multiple(e.bytes, source, unknown->factor);
    Few<Unknown, code::kMostSources> rest;
    for (const Unknown& u : e.unknown) {
      if (u.name != name) rest.push_back(u);
    }
    e.unknown = rest;
  }
  return any;
}

// One that is over, or the oldest.
WindowReceiver::Equation& WindowReceiver::place_for_symbol() {
  const auto over =
      std::ranges::find_if(equations_, [](const Equation& e) { return e.unknown.empty(); });
  Equation& place = over != equations_.end()
                        ? *over
                        : *std::ranges::min_element(equations_, {}, &Equation::number);
  place.number = ++symbols_;
  place.unknown = {};
  return place;
}

void WindowReceiver::symbol(TimePoint now, const wire::Window& window, std::size_t room) {
  if (!idle_at_ && room < kHeld) return;
  idle_at_ = now + kIdle;
  if (sources_.capacity() < kMostKept) sources_.reserve(kMostKept);
  equations_.resize(code::Equations::kMost);
  Equation& e = place_for_symbol();
  e.bytes.assign(window.bytes.begin(), window.bytes.end());
  bool is_sound = true;
  window.header.for_each([&](std::size_t column, MessageId message, std::uint8_t index) {
    const Name name{message, index};
    const std::uint8_t factor = code::coefficient(window.header.row, column);
    const Source* known = find(name);
    if (known == nullptr) {
      e.unknown.push_back({name, factor});
    } else if (known->bytes.size() <= e.bytes.size()) {
      code::add_multiple(e.bytes, known->bytes, factor);
    } else {
      is_sound = false;
    }
  });
  if (!is_sound) e.unknown = {};
  while (solve()) {
  }
}

// The symbols that can be solved together, the newest first: what the oldest miss may never come.
WindowReceiver::System WindowReceiver::open_system() {
  Few<Equation*, code::Equations::kMost> open;
  for (Equation& e : equations_) {
    if (!e.unknown.empty()) open.push_back(&e);
  }
  std::ranges::sort(open, std::greater(), &Equation::number);
  System out;
  for (Equation* e : open) {
    const auto is_new = [&out](const Unknown& u) {
      return std::ranges::find(out.unknown, u.name) == out.unknown.end();
    };
    const auto more = static_cast<std::size_t>(std::ranges::count_if(e->unknown, is_new));
    if (out.unknown.size() + more > code::Equations::kMostUnknown) continue;
    for (const Unknown& u : e->unknown) {
      if (is_new(u)) out.unknown.push_back(u.name);
      const auto at = std::ranges::find(out.unknown, u.name) - out.unknown.begin();
      out.equations.factors[out.rows.size()][static_cast<std::size_t>(at)] = u.factor;
    }
    out.rows.push_back(e);
  }
  out.equations.count = out.rows.size();
  out.equations.unknown = out.unknown.size();
  return out;
}

bool WindowReceiver::solve() {
  const System system = open_system();
  std::array<code::Solution, code::Equations::kMost> solutions;
  if (code::solve(system.equations, solutions) == 0) return false;
  const auto& [which, factors] = solutions[0];
  scratch_.clear();
  for (std::size_t i = 0; i < system.rows.size(); ++i) {
    if (factors[i] == 0) continue;
    scratch_.resize(std::max(scratch_.size(), system.rows[i]->bytes.size()));
    code::add_multiple(scratch_, system.rows[i]->bytes, factors[i]);
  }
  const Name name = system.unknown[which];
  if (const auto data = wire::get_source(name.message, name.index, scratch_)) {
    const ByteView all = ByteView(scratch_).first(wire::kSourceHeaderBytes + data->bytes.size());
    keep(name, all, {});
    computed_.push_back(name);
    take_off(name, all);
    return true;
  }
  // One of them lies.
  for (std::size_t i = 0; i < system.rows.size(); ++i) {
    if (factors[i] != 0) system.rows[i]->unknown = {};
  }
  return true;
}

std::optional<wire::Data> WindowReceiver::poll() {
  while (has_computed()) {
    const Name name = computed_[handed_out_++];
    if (!has_computed()) {
      computed_ = {};
      handed_out_ = 0;
    }
    const Source* source = find(name);
    if (source != nullptr) return wire::get_source(name.message, name.index, source->bytes);
  }
  return std::nullopt;
}

void WindowReceiver::handle_timeout(TimePoint now) {
  if (idle_at_ && *idle_at_ <= now) *this = {};
}

}  // namespace interneuron::flow
