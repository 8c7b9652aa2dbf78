// Runs in which every message's predicted chance is noted beside what became of it, in virtual
// time. Pure; the same scenario gives the same on any machine. Thread-safe: runs share nothing.
#pragma once

#include <vector>

#include "core/messages/outlook.h"
#include "interneuron/send.h"
#include "lab/load/calibration.h"
#include "lab/load/forecast_scenario.h"

namespace interneuron::load {

// What predictions rest on and what became of them, one step after the other: a message that was
// handed over and whose chance was told, or a fate. Peers and messages have other names here than
// in their endpoints, so that no two endpoints of a run use the same. Where the peer has several
// links, the outlook is over the one that would bring the smallest variant first.
struct ForecastStep {
  bool is_message = false;
  // Of a message: what was known of it, its name if it was accepted, whether it is judged (an
  // accepted one, or one that was sent although it was refused), and if so what was predicted and
  // what happened.
  Outlook outlook{};
  SendId id{};
  bool judged = false;
  Forecast forecast{};
  // Of a fate.
  MessageFate fate{};
};

// The steps of two runs of the same scenario and seed: of one as it is, of which accepted messages
// are judged; and of one in which now and then a message that send() refuses is sent nevertheless,
// beside send(). What is predicted does not learn of these, and few enough are sent that the load
// is what it was.
struct ForecastRun {
  std::vector<ForecastStep> accepted;
  std::vector<ForecastStep> nevertheless;
};
ForecastRun forecast_run(const ForecastScenario& scenario);

// What was predicted in both, and what happened.
std::vector<Forecast> forecasts(const ForecastScenario& scenario);

}  // namespace interneuron::load
