// A frame with its boxes, for people to look at.
#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <string>

#include "app/perception/detection.h"
#include "app/perception/input_error.h"

namespace interneuron::perception {

// The frame with boxes and scores, and below it a strip with the caption (ASCII; other bytes show
// as "?"). Boxes are in pixels of the frame; boxes scored below `min_score` are left out. Requires:
// bgr not empty, 8 bits, 3 channels.
cv::Mat draw_boxes(const cv::Mat& bgr, std::span<const Box> boxes, const std::string& caption,
                   float min_score = 0.3F);

// draw_boxes() as the bytes of a PNG file. Throws InputError when it cannot be encoded.
std::string png_picture(const cv::Mat& bgr, std::span<const Box> boxes, const std::string& caption,
                        float min_score = 0.3F);

}  // namespace interneuron::perception
