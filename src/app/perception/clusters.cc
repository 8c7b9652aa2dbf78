#include "app/perception/clusters.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <unordered_map>
#include <unordered_set>

#include "app/perception/voxel_key.h"

namespace interneuron::perception {
namespace {

// --- Ground. One plane for the whole sweep; the paper divides it into several.
constexpr int kFits = 3;
// The mean height of this share of the points, the lowest ones, is the first guess of the ground's.
constexpr double kLowestShare = 0.05;
// Points up to so far above the first guess make the first plane, m; the paper's.
constexpr float kSeedHeight = 0.4F;
// Points up to so far above the plane are ground, m: a kerb of 15 cm on a road that is no plane.
constexpr float kGroundHeight = 0.3F;

// --- Groups.
// Points this near to each other are of one group, m: so far apart are the rings of a sensor of
// 1.33 degrees, as that of nuScenes, 30 m away, and less than that the centroids of most
// neighbouring voxels of the coarsest level.
constexpr float kTolerance = 0.7F;
// A group needs so many occupied voxels of this side. Counting voxels and not points makes the
// bound the same for thinned sweeps.
constexpr float kCountedVoxel = 0.4F;
constexpr std::size_t kLeastVoxels = 4;
// No vehicle on the road is longer, m (articulated buses may have 18.75 m in the European Union,
// Directive 96/53/EC); what is longer is a building or a hedge.
constexpr float kLongest = 20;

// Points count as no nearer to an edge than this, m, half of the sensors' noise: it bounds the
// weight of one of them.
constexpr float kNearest = 0.01F;

// The thresholds of COCO's AP: .50, .55 … .95.
constexpr double kLeastIou = 0.5;
constexpr double kClusterIouStep = 0.05;
constexpr int kThresholds = 10;

struct Plane {
  Eigen::Vector3f normal;
  float offset = 0;
  float height(const Eigen::Vector3f& p) const { return normal.dot(p) - offset; }
};

// By least squares; upright where the points are too few.
Plane plane_through(const Points& points, const std::vector<Eigen::Index>& of) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Index i : of) mean += points.col(i).head<3>().cast<double>();
  mean /= static_cast<double>(std::max<std::size_t>(of.size(), 1));
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Index i : of) {
    const Eigen::Vector3d d = points.col(i).head<3>().cast<double>() - mean;
    spread += d * d.transpose();
  }
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  if (of.size() >= 3) {
    normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
  }
  if (normal.z() < 0) normal = -normal;
  return {normal.cast<float>(), static_cast<float>(normal.dot(mean))};
}

Points without_ground(const Points& points) {
  std::vector<float> heights(points.row(2).begin(), points.row(2).end());
  const auto lowest =
      1 + static_cast<std::ptrdiff_t>(kLowestShare * static_cast<double>(heights.size() - 1));
  std::nth_element(heights.begin(), heights.begin() + lowest - 1, heights.end());
  const float guess =
      std::accumulate(heights.begin(), heights.begin() + lowest, 0.0F) / static_cast<float>(lowest);
  Plane plane{Eigen::Vector3f::UnitZ(), guess};
  float reach = kSeedHeight;
  std::vector<Eigen::Index> ground;
  for (int fit = 0; fit < kFits; ++fit) {
    ground.clear();
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      if (plane.height(points.col(i).head<3>()) < reach) ground.push_back(i);
    }
    plane = plane_through(points, ground);
    reach = kGroundHeight;
  }
  Points out(4, points.cols());
  Eigen::Index kept = 0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    if (plane.height(points.col(i).head<3>()) >= reach) out.col(kept++) = points.col(i);
  }
  out.conservativeResize(Eigen::NoChange, kept);
  return out;
}

// --- Union and find.
class Groups {
 public:
  explicit Groups(std::size_t members) : parents_(members) {
    std::iota(parents_.begin(), parents_.end(), std::uint32_t{0});
  }
  // One member stands for its group.
  std::uint32_t of(std::uint32_t member) {
    while (parents_[member] != member) {
      parents_[member] = parents_[parents_[member]];
      member = parents_[member];
    }
    return member;
  }
  // The lower number stands for both.
  void join(std::uint32_t a, std::uint32_t b) {
    a = of(a);
    b = of(b);
    parents_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parents_;
};

// Points by the cell of a grid of kTolerance, so that those near a point are in its cell and in the
// 26 around it.
class Cells {
 public:
  explicit Cells(const Points& points) : points_(points) {
    index_.reserve(static_cast<std::size_t>(points.cols()));
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      const Voxel voxel = voxel_of(points.col(i).head<3>(), kTolerance);
      const auto [at, is_new] = index_.try_emplace(key_of(voxel), cells_.size());
      if (is_new) cells_.push_back({voxel, {}});
      cells_[at->second].members.push_back(static_cast<std::uint32_t>(i));
    }
  }

  Groups groups() const {
    Groups groups(static_cast<std::size_t>(points_.cols()));
    for (const Cell& cell : cells_) {
      join(cell, cell, groups);
      // Half of the neighbours: the others look at this cell.
      for (int n = kAround / 2 + 1; n < kAround; ++n) {
        const Voxel by(n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1);
        const auto at = index_.find(key_of(cell.voxel + by));
        if (at != index_.end()) join(cell, cells_[at->second], groups);
      }
    }
    return groups;
  }

 private:
  static constexpr int kAround = 27;

  struct Cell {
    Voxel voxel;
    std::vector<std::uint32_t> members;
  };

  void join(const Cell& a, const Cell& b, Groups& groups) const {
    for (const std::uint32_t i : a.members) {
      for (const std::uint32_t j : b.members) {
        const float apart = (points_.col(i) - points_.col(j)).head<3>().squaredNorm();
        if (apart <= kTolerance * kTolerance) groups.join(i, j);
      }
    }
  }

  const Points& points_;
  std::unordered_map<std::uint64_t, std::size_t, VoxelHash> index_;
  std::vector<Cell> cells_;
};

// --- Boxes.
using Row = Eigen::ArrayXf;

// How near points lie to the edges of a box around them, along whose axes their coordinates are u
// and v: the criterion of closeness of the paper.
float closeness(const Row& u, const Row& v) {
  const auto to_edge = [](const Row& c) -> Row {
    const Row low = c - c.minCoeff();
    const Row high = c.maxCoeff() - c;
    return low.matrix().squaredNorm() < high.matrix().squaredNorm() ? low : high;
  };
  return to_edge(u).min(to_edge(v)).max(kNearest).inverse().sum();
}

cv::RotatedRect box_of(const Row& x, const Row& y) {
  Row u;
  Row v;
  const auto turn = [&](int degrees) {
    const float heading = static_cast<float>(degrees) * std::numbers::pi_v<float> / 180;
    u = x * std::cos(heading) + y * std::sin(heading);
    v = y * std::cos(heading) - x * std::sin(heading);
  };
  int best = 0;
  float most = 0;
  for (int degrees = 0; degrees < 90; ++degrees) {
    turn(degrees);
    const float fits = closeness(u, v);
    if (fits <= most) continue;
    most = fits;
    best = degrees;
  }
  turn(best);
  const Eigen::Vector2f low(u.minCoeff(), v.minCoeff());
  const Eigen::Vector2f high(u.maxCoeff(), v.maxCoeff());
  const float heading = static_cast<float>(best) * std::numbers::pi_v<float> / 180;
  const Eigen::Vector2f centre = Eigen::Rotation2Df(heading) * ((low + high) / 2);
  const Eigen::Vector2f size = high - low;
  return {{centre.x(), centre.y()}, {size.x(), size.y()}, static_cast<float>(best)};
}

// The box of a group, if it may be one of an object.
std::optional<Cluster> cluster_of(const Points& points, const std::vector<Eigen::Index>& members) {
  std::unordered_set<std::uint64_t, VoxelHash> voxels;
  for (const Eigen::Index i : members) {
    if (voxels.size() == kLeastVoxels) break;
    voxels.insert(key_of(voxel_of(points.col(i).head<3>(), kCountedVoxel)));
  }
  if (voxels.size() < kLeastVoxels) return std::nullopt;
  const Row x = points.row(0)(members);
  const Row y = points.row(1)(members);
  const Row z = points.row(2)(members);
  const float size = std::hypot(x.maxCoeff() - x.minCoeff(), y.maxCoeff() - y.minCoeff());
  if (size > kLongest) return std::nullopt;
  return Cluster{box_of(x, y), z.minCoeff(), z.maxCoeff()};
}

// Members by group, in the order of the first ones.
std::vector<std::vector<Eigen::Index>> groups_of(const Points& points) {
  Groups groups = Cells(points).groups();
  std::vector<std::vector<Eigen::Index>> out;
  std::unordered_map<std::uint32_t, std::size_t> index;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const auto [at, is_new] =
        index.try_emplace(groups.of(static_cast<std::uint32_t>(i)), out.size());
    if (is_new) out.emplace_back();
    out[at->second].push_back(i);
  }
  return out;
}

// Seen from above.
double iou(const Cluster& a, const Cluster& b) {
  const float apart = static_cast<float>(cv::norm(a.area.center - b.area.center));
  const auto reach = [](const Cluster& c) {
    return std::hypot(c.area.size.width, c.area.size.height) / 2;
  };
  if (apart >= reach(a) + reach(b)) return 0;
  std::vector<cv::Point2f> corners;
  cv::rotatedRectangleIntersection(a.area, b.area, corners);
  if (corners.size() < 3) return 0;
  std::vector<cv::Point2f> hull;
  cv::convexHull(corners, hull);
  const double common = cv::contourArea(hull);
  const double all =
      static_cast<double>(a.area.size.area()) + static_cast<double>(b.area.size.area()) - common;
  return all > 0 ? common / all : 0;
}

}  // namespace

std::span<const ClusterLevel> cluster_levels() {
  static const std::vector<ClusterLevel> kLevels{{"40 cm", 0.4}, {"20 cm", 0.2}, {"all points", 0}};
  return kLevels;
}

std::vector<Cluster> find_clusters(const Points& points, const ClusterLevel& level) {
  if (points.cols() == 0) return {};
  const Points above =
      without_ground(level.voxel_m > 0 ? voxel_grid(points, level.voxel_m) : points);
  std::vector<Cluster> out;
  for (const std::vector<Eigen::Index>& members : groups_of(above)) {
    if (const auto cluster = cluster_of(above, members)) out.push_back(*cluster);
  }
  return out;
}

double agreement(std::span<const Cluster> found, std::span<const Cluster> reference) {
  if (found.empty() && reference.empty()) return 1;
  struct Pair {
    double iou;
    std::size_t found;
    std::size_t reference;
  };
  std::vector<Pair> pairs;
  for (std::size_t f = 0; f < found.size(); ++f) {
    for (std::size_t r = 0; r < reference.size(); ++r) {
      const double overlap = iou(found[f], reference[r]);
      if (overlap >= kLeastIou) pairs.push_back({overlap, f, r});
    }
  }
  std::ranges::stable_sort(pairs, std::greater(), &Pair::iou);
  std::vector<bool> found_taken(found.size());
  std::vector<bool> reference_taken(reference.size());
  // The thresholds that the matched pairs reach, added up.
  int reached = 0;
  for (const Pair& p : pairs) {
    if (found_taken[p.found] || reference_taken[p.reference]) continue;
    found_taken[p.found] = reference_taken[p.reference] = true;
    for (int t = 0; t < kThresholds; ++t) {
      if (p.iou >= kLeastIou + kClusterIouStep * t) ++reached;
    }
  }
  return 2.0 * reached / kThresholds / static_cast<double>(found.size() + reference.size());
}

}  // namespace interneuron::perception
