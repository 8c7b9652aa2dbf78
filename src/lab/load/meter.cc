#include "lab/load/meter.h"

#include <cassert>

#include "core/base/statistics.h"

namespace interneuron::load {

Meter::Meter(std::size_t vehicles, Duration deadline, std::vector<std::size_t> variant_bytes)
    : deadline_(deadline), variant_bytes_(std::move(variant_bytes)), fates_(vehicles) {}

std::uint32_t Meter::begin(std::size_t vehicle, Duration now) {
  fates_[vehicle].push_back({now, std::nullopt, 0});
  return static_cast<std::uint32_t>(fates_[vehicle].size() - 1);
}

void Meter::arrived(std::size_t vehicle, std::uint32_t number, std::size_t variant, Duration now) {
  assert(vehicle < fates_.size() && number < fates_[vehicle].size());
  assert(variant < variant_bytes_.size());
  Message& message = fates_[vehicle][number];
  if (message.arrived) return;
  message.arrived = now;
  message.variant = variant;
}

bool Meter::on_time(const Message& message) const {
  return message.arrived && *message.arrived - message.begun <= deadline_;
}

std::size_t Meter::on_time_bytes(std::size_t vehicle) const {
  return on_time_bytes(vehicle, Duration::min(), Duration::max());
}

std::size_t Meter::on_time_bytes() const {
  std::size_t out = 0;
  for (std::size_t v = 0; v < fates_.size(); ++v) out += on_time_bytes(v);
  return out;
}

std::size_t Meter::on_time_bytes(std::size_t vehicle, Duration from, Duration to) const {
  std::size_t out = 0;
  for (const Message& m : fates_[vehicle]) {
    if (on_time(m) && *m.arrived > from && *m.arrived <= to) out += variant_bytes_[m.variant];
  }
  return out;
}

std::size_t Meter::count() const {
  std::size_t out = 0;
  for (const auto& messages : fates_) out += messages.size();
  return out;
}

std::size_t Meter::missed() const {
  std::size_t out = 0;
  for (const auto& messages : fates_) {
    for (const Message& m : messages) out += on_time(m) ? 0 : 1;
  }
  return out;
}

std::size_t Meter::degraded() const {
  std::size_t out = 0;
  for (const auto& messages : fates_) {
    for (const Message& m : messages) out += on_time(m) && m.variant > 0 ? 1 : 0;
  }
  return out;
}

Duration Meter::age(double q) const {
  std::vector<Duration> ages;
  for (const auto& messages : fates_) {
    for (const Message& m : messages) {
      if (on_time(m)) ages.push_back(*m.arrived - m.begun);
    }
  }
  return percentile(std::move(ages), q);
}

double Meter::jain(const std::vector<Duration>& spans) const {
  assert(spans.size() == fates_.size());
  double sum = 0;
  double squares = 0;
  for (std::size_t v = 0; v < fates_.size(); ++v) {
    const double rate = static_cast<double>(on_time_bytes(v)) / to_seconds(spans[v]);
    sum += rate;
    squares += rate * rate;
  }
  return squares > 0 ? sum * sum / (static_cast<double>(fates_.size()) * squares) : 0;
}

}  // namespace interneuron::load
