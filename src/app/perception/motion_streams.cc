#include "app/perception/motion_streams.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace interneuron::perception {

MotionStreams::Key MotionStreams::key_of(const Image& image) {
  // Raw and sampled show the same, and so do the JPEGs.
  Variant form = image.variant;
  if (form == Variant::kSampled) form = Variant::kRaw;
  if (is_jpeg(form)) form = Variant::kJpeg;
  return {image.sender, image.source.width, image.source.height, static_cast<int>(form)};
}

const cv::Mat& MotionStreams::mask(const Image& image, TimePoint now) {
  return stream(key_of(image), now).model->mask(image);
}

const cv::Mat& MotionStreams::mask(const Image& image) {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return mask(image, TimePoint{std::chrono::duration_cast<Duration>(now)});
}

void MotionStreams::forget(std::uint32_t sender) {
  std::erase_if(streams_, [sender](const auto& entry) { return entry.first.sender == sender; });
}

MotionStreams::Stream& MotionStreams::stream(const Key& key, TimePoint now) {
  std::erase_if(streams_, [now](const auto& entry) { return now - entry.second.used > kLifetime; });
  auto found = streams_.find(key);
  if (found == streams_.end()) {
    make_room(key.sender);
    found = streams_.emplace(key, Stream{std::make_unique<MotionModel>(), now}).first;
  }
  found->second.used = now;
  return found->second;
}

std::size_t MotionStreams::of_sender(std::uint32_t sender) const {
  return static_cast<std::size_t>(std::ranges::count_if(
      streams_, [sender](const auto& entry) { return entry.first.sender == sender; }));
}

// A sender that has all that it may have gives up a stream of its own, else whoever has most.
void MotionStreams::make_room(std::uint32_t sender) {
  const bool full = streams_.size() >= kMaxStreams;
  const bool own = of_sender(sender) >= kMaxPerSender;
  if (!full && !own) return;
  // How much there is to be said for keeping it: the fewer streams its sender has and the later it
  // was used, the more.
  const auto worth = [&](const auto& entry) {
    const auto count = static_cast<std::int64_t>(of_sender(entry.first.sender));
    const bool candidate = !own || entry.first.sender == sender;
    return std::pair{candidate ? -count : 1, entry.second.used};
  };
  streams_.erase(std::ranges::min_element(streams_, {}, worth));
}

}  // namespace interneuron::perception
