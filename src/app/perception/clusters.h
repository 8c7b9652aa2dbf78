// Objects in lidar sweeps, without learning: the ground is taken away, what is left is divided into
// groups of points that are near each other, and each group gets a box.
//
// The ground is a plane that is fitted repeatedly to the points near it ("Fast Segmentation of 3D
// Point Clouds: A Paradigm on LiDAR Data for Autonomous Vehicle Applications", Zermas, Izzat,
// Papanikolopoulos 2017); the groups are those of Euclidean clustering ("Semantic 3D Object Maps
// for Everyday Manipulation in Human Living Environments", Rusu 2009); boxes are turned so that
// points lie along their edges ("Efficient L-Shape Fitting for Vehicle Detection Using Laser
// Scanners", Zhang, Xu, Dong, Dolan 2017).
//
// Pure functions: safe from any thread.
#pragma once

#include <opencv2/core.hpp>
#include <span>
#include <string>
#include <vector>

#include "app/perception/point_cloud.h"

namespace interneuron::perception {

// The box of a group of points, in the frame of the sweep, m.
struct Cluster {
  // Seen from above.
  cv::RotatedRect area;
  // Along z.
  float low = 0;
  float high = 0;
};

// One quality level: the closer the sweep is looked at, the more time it takes.
struct ClusterLevel {
  std::string name;
  // The sweep is thinned to voxels of this side first, m; 0: all of its points are used.
  double voxel_m = 0;
};

// From the lightest to the best.
std::span<const ClusterLevel> cluster_levels();

// The groups of the size of what takes part in traffic, in the order of their first points. Any
// valid points will do, but the time grows with the square of the points that lie within 70 cm of
// each other: what a stranger sends is to be looked at through voxels.
std::vector<Cluster> find_clusters(const Points& points, const ClusterLevel& level);

// How well `found` agrees with `reference`, in [0, 1]: F1 (the harmonic mean of precision and
// recall) of clusters that are matched one to one, those that overlap most first; the mean over
// COCO's thresholds of the intersection over union, .50 to .95, of boxes seen from above. 1 where
// both are empty. The reference is another level's answer and no truth: this is agreement and not
// accuracy.
double agreement(std::span<const Cluster> found, std::span<const Cluster> reference);

}  // namespace interneuron::perception
