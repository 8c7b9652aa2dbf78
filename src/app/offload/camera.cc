#include "app/offload/camera.h"

namespace interneuron::cli {

void Camera::fetch(Node& node) {
  fetching_ = true;
  node.compute(Queue::kLocalBackup, [this]() -> Node::Task {
    return [this, frame = source_.next()] {
      next_ = frame;
      fetching_ = false;
      if (const auto then = std::exchange(then_, nullptr)) then();
    };
  });
}

}  // namespace interneuron::cli
