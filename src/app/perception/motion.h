// What moves in front of fixed cameras: a background model for each stream of images.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/video/background_segm.hpp>
#include <optional>
#include <vector>

#include "app/perception/codec.h"
#include "interneuron/time.h"

namespace interneuron::perception {

// A connected area that moves, in pixels of the mask.
struct Blob {
  cv::Rect rect;
  // How many pixels of the rectangle move.
  int area = 0;
};

// The background model of one fixed camera, shared by all levels of a ladder. MotionStreams keeps
// one for each camera. One thread at a time.
class MotionModel {
 public:
  MotionModel();

  // The mask of what moves in the image, kSampledWidth x kSampledHeight, 255 or 0. Learns from the
  // image, but only once from a frame number, so that any number of levels may ask. Raw and sampled
  // images of a frame look the same to it. All 0 until a background is known.
  const cv::Mat& mask(const Image& image);
  void reset();

 private:
  cv::Ptr<cv::BackgroundSubtractorMOG2> subtractor_;
  cv::Mat mask_;
  // The number of the frame that mask_ is of.
  std::optional<std::uint32_t> frame_;
  // Frames learnt from since the last reset, at most as many as make a background.
  int learnt_ = 0;
};

// The connected areas of a mask after closing holes up to `close`, and growing by `grow` (both in
// pixels).
std::vector<Blob> blobs_of(const cv::Mat& mask, cv::Size close, cv::Size grow);

// A background model for each stream of images, so that nobody's images are part of what another is
// told: a roadside unit detects for many vehicles, each in front of its own scene, and frames of
// several vehicles have the same numbers.
//
// A stream is what one sender sends of one camera in one form: Image::sender, the size of the
// source, and whether it is raw or sampled (which show the same), grey, or a JPEG of any form. Its
// model is made with its first image and forgotten after kLifetime without one.
//
// Bounds: kMaxPerSender models for a sender, beyond which its least recently used one goes;
// kMaxStreams in all, beyond which that of the sender who has most of them goes, so that a sender
// of many forms takes nothing from those who have one. A model has 4.4 MB (five Gaussians of three
// colours for each pixel of the mask), all of them at most 280 MB. Used by one thread at a time.
class MotionStreams {
 public:
  // Four times the vehicles that a roadside unit accepts by default.
  static constexpr std::size_t kMaxStreams = 64;
  // One that is used, and one that a change of the camera's form leaves behind.
  static constexpr std::size_t kMaxPerSender = 2;
  // A scene that was not seen for so long has another light, or is another one. No measurement
  // behind it.
  static constexpr Duration kLifetime = std::chrono::seconds(60);

  // MotionModel::mask() of the image's stream; valid until the next call.
  const cv::Mat& mask(const Image& image, TimePoint now);
  // The same at the time of the steady clock.
  const cv::Mat& mask(const Image& image);
  // Forgets the streams of a sender.
  void forget(std::uint32_t sender);
  void reset() { streams_.clear(); }
  std::size_t size() const { return streams_.size(); }

 private:
  struct Key {
    std::uint32_t sender = 0;
    int width = 0;
    int height = 0;
    int form = 0;
    friend auto operator<=>(const Key&, const Key&) = default;
  };
  struct Stream {
    std::unique_ptr<MotionModel> model;
    TimePoint used{};
  };

  static Key key_of(const Image& image);
  Stream& stream(const Key& key, TimePoint now);
  std::size_t of_sender(std::uint32_t sender) const;
  void make_room(std::uint32_t sender);

  std::map<Key, Stream> streams_;
};

}  // namespace interneuron::perception
