#include "lab/eval/metrics.h"

#include <cmath>
#include <iterator>

namespace interneuron::eval {
namespace {

// The 97.5 % quantile of the normal distribution, which bounds a two-sided interval of 95 %.
constexpr double kNormal = 1.959964;

// The 97.5 % quantiles of Student's t, by degrees of freedom from 1. Beyond 30 degrees the normal's
// is within 0.04 of them.
constexpr double kStudent[] = {12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23,
                               2.20,  2.18, 2.16, 2.14, 2.13, 2.12, 2.11, 2.10, 2.09, 2.09,
                               2.08,  2.07, 2.07, 2.06, 2.06, 2.06, 2.05, 2.05, 2.05, 2.04};

// Two digits, as the table has.
constexpr double kStudentBeyond = 1.96;

double student(std::size_t freedom) {
  return freedom <= std::size(kStudent) ? kStudent[freedom - 1] : kStudentBeyond;
}

}  // namespace

Interval wilson95(std::uint64_t hits, std::uint64_t n) {
  if (n == 0) return {0, 1};
  constexpr double z = kNormal;
  const auto count = static_cast<double>(n);
  const double p = static_cast<double>(hits) / count;
  const double scale = 1 + z * z / count;
  const double middle = (p + z * z / (2 * count)) / scale;
  const double half = z * std::sqrt(p * (1 - p) / count + z * z / (4 * count * count)) / scale;
  return {hits == 0 ? 0 : middle - half, hits == n ? 1 : middle + half};
}

Paired paired95(std::span<const double> differences) {
  const auto n = static_cast<double>(differences.size());
  Paired out;
  for (const double d : differences) out.mean += d / n;
  if (differences.size() < 2) return out;
  double squares = 0;
  for (const double d : differences) squares += (d - out.mean) * (d - out.mean);
  const double half = student(differences.size() - 1) * std::sqrt(squares / (n - 1) / n);
  out.ci95 = {out.mean - half, out.mean + half};
  return out;
}

}  // namespace interneuron::eval
