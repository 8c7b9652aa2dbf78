#include "node/io/parts.h"

// Weak references leave a part that is not linked null. In libinterneuron-all.a those to the parts
// that it holds are strong, because a weak one takes nothing out of an archive.
#ifndef INTERNEURON_HOLDS_monitor
#pragma weak interneuron_monitor_part
#endif
#ifndef INTERNEURON_HOLDS_ring
#pragma weak interneuron_ring_part
#endif
#ifndef INTERNEURON_HOLDS_xdp
#pragma weak interneuron_xdp_part
#endif

namespace interneuron::io {

const MonitorPart* monitor_part() { return &interneuron_monitor_part; }
const TransportPart* ring_part() { return &interneuron_ring_part; }
const TransportPart* xdp_part() { return &interneuron_xdp_part; }

}  // namespace interneuron::io
