#include "app/offload/camera.h"

namespace interneuron::offload {

void Camera::fetch(Node& node) {
  fetching_ = true;
  node.compute(Queue::kLocalBackup, [this]() -> Node::Task {
    std::optional<Shot> shot;
    if (auto frame = source_.next()) {
      const auto index = static_cast<std::uint32_t>(frame->index);
      shot = Shot{*frame, perception::make_variant(frame->bgr, index, perception::Variant::kRaw)};
    }
    return [this, shot] {
      next_ = shot;
      fetching_ = false;
      if (const auto then = std::exchange(then_, nullptr)) then();
    };
  });
}

}  // namespace interneuron::offload
