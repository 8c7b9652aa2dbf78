// How busy a machine was while a test measured time on it. A test that needs a quiet processor
// makes one of these, measures, and where the figure is out of its bound asks busy(): then it tries
// again, and at last skips.
#pragma once

#include <chrono>
#include <fstream>
#include <string>

namespace interneuron {

class RunQueue {
 public:
  // Share of the time since this object was made in which some thread of this machine could have
  // run and waited for a processor, as the kernel counts it (Documentation/accounting/psi.rst,
  // "some"); 0 where it does not.
  double waited() const {
    const std::chrono::duration<double, std::micro> past = Clock::now() - began_;
    return (waited_us() - waited_us_) / past.count();
  }
  // What a test does by itself makes threads wait too, on two processors a third of the time at
  // most.
  bool busy() const { return waited() > 0.6; }

 private:
  using Clock = std::chrono::steady_clock;

  static double waited_us() {
    std::ifstream file("/proc/pressure/cpu");
    const std::string mark = "total=";
    for (std::string word; file >> word;) {
      if (word.starts_with(mark)) return std::stod(word.substr(mark.size()));
    }
    return 0;
  }

  Clock::time_point began_ = Clock::now();
  double waited_us_ = waited_us();
};

}  // namespace interneuron
