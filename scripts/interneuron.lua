-- Wireshark dissector of Interneuron's packets (docs/wire_format.md): data with the plain or round header of a message's
-- first piece, feedback with its reports, windows, probes, challenges and tokens, echoes with the STAMP packet (RFC 8762) inside;
-- the packets of handshakes; and of sealed packets what is not encrypted. Keys are not asked for, and nothing is checked with them.
--
--   wireshark -X lua_script:scripts/interneuron.lua capture.pcap
--   tshark    -X lua_script:scripts/interneuron.lua -r capture.pcap -Y 'interneuron.type == 2'
--
-- or copy it into the folder of personal Lua plugins (Help, About, Folders). UDP port 47000 is taken by default; other
-- ports by Preferences, Protocols, INTERNEURON, or because the packets look like ours. Every field has a name to filter by: "interneuron.".

local interneuron = Proto("interneuron", "Interneuron")

local VERSION = 3
local HEADER_BYTES = 20
local TAG_BYTES = 16
local PIECE_BYTES = 17
-- Pieces and repair symbols of one block.
local MOST_PIECES = 200
local MOST_ROWS = 55
local PLAIN_HEADER_BYTES = 20
local ROUND_HEADER_BYTES = 98
local FEEDBACK_BYTES = 17
local REPORT_BYTES = 107
local STAMP_BYTES = 44
-- The largest packet that is ever sent.
local MOST_BYTES = 1400
-- Of a window: its fields with one message, what it covers at most, and the shortest symbol.
local WINDOW_BYTES = 7
local MOST_MESSAGES = 16
local MOST_SOURCES = 32
local FEWEST_CODED = 12
local TOKEN_BYTES = 16

-- What of a sealed packet is not encrypted.
local ASSOCIATED_BYTES = 16
local INITIATION, RESPONSE, COOKIE = 5, 9, 10
-- An initiation may have a credential in its hello.
local CREDENTIAL_BYTES = 129
local HANDSHAKE_BYTES = { [INITIATION] = 189, [RESPONSE] = 125, [COOKIE] = 76 }

local TYPES = { [1] = "data", [2] = "feedback", [3] = "probe", [4] = "echo", [INITIATION] = "initiation", [6] = "window",
  [7] = "challenge", [8] = "token", [RESPONSE] = "response", [COOKIE] = "cookie" }
local EPOCHS = { [0] = "in the clear", [1] = "sealed" }
local KINDS = { [0] = "round", [1] = "plain" }
local CLASSES = { [0] = "data", [1] = "result" }
local GUARDS = { [0] = "paper", [1] = "budget" }
local STATES = { [0] = "unknown", [1] = "on time", [2] = "missed", [3] = "malformed" }

local f = {}
local function field(name, make, title, ...)
  f[name] = make("interneuron." .. name, title, ...)
end

field("version", ProtoField.uint8, "Version", base.DEC, nil, 0xf0)
field("type", ProtoField.uint8, "Type", base.DEC, TYPES, 0x0f)
field("link", ProtoField.uint16, "Link", base.DEC, nil, nil, "The path: the number that the side which connected gives to it")
field("epoch", ProtoField.uint8, "Epoch", base.DEC, EPOCHS)
field("session", ProtoField.uint32, "Session", base.HEX, nil, nil,
  "In the clear the sender's, sealed the number that the receiver gave to the keys, in a handshake that of the initiator")
field("number", ProtoField.uint64, "Number", base.DEC, nil, nil, "Counts the sender's packets on this path")
field("stamp_us", ProtoField.uint32, "Stamp (us)", base.DEC, nil, nil, "The sender's clock, modulo 2^32")
field("sealed", ProtoField.bytes, "Encrypted stamp and body")
field("sealed_bytes", ProtoField.uint32, "Bytes of the body", base.DEC)
field("body", ProtoField.bytes, "Body")
field("tag", ProtoField.bytes, "Tag")
field("padding", ProtoField.bytes, "Padding")

field("message", ProtoField.uint32, "Message", base.DEC)
field("index", ProtoField.uint16, "Piece", base.DEC)
field("size", ProtoField.uint32, "Bytes of the message", base.DEC)
field("count", ProtoField.uint32, "Pieces", base.DEC)
field("chunk", ProtoField.uint16, "Chunk", base.DEC, nil, nil, "Size of every piece but the last, bytes")
field("lifetime_us", ProtoField.uint32, "Lifetime (us)", base.DEC)
field("kind", ProtoField.uint8, "Kind", base.DEC, KINDS)
field("repair.block", ProtoField.uint16, "Block", base.DEC)
field("repair.row", ProtoField.uint16, "Row", base.DEC)
field("repair.symbol", ProtoField.bytes, "Repair symbol")
field("payload", ProtoField.bytes, "Payload")
field("window.row", ProtoField.uint8, "Row", base.DEC)
field("window.messages", ProtoField.uint8, "Messages covered", base.DEC)
field("window.message", ProtoField.uint32, "Message covered", base.DEC)
field("window.pieces", ProtoField.uint8, "Pieces covered", base.HEX, nil, nil, "Bit i: piece i")
field("window.symbol", ProtoField.bytes, "Symbol")
field("token", ProtoField.bytes, "Token")

field("handshake.ephemeral", ProtoField.bytes, "Ephemeral key")
field("handshake.static", ProtoField.bytes, "Encrypted static key")
field("handshake.hello", ProtoField.bytes, "Encrypted hello")
field("handshake.proof", ProtoField.bytes, "Proof")
field("handshake.mac1", ProtoField.bytes, "mac1")
field("handshake.mac2", ProtoField.bytes, "mac2")
field("handshake.has_cookie", ProtoField.bool, "Made with a cookie")
field("handshake.nonce", ProtoField.bytes, "Nonce")
field("handshake.cookie", ProtoField.bytes, "Encrypted cookie")

field("plain.id", ProtoField.uint32, "Message of the application", base.DEC)
field("plain.deadline_us", ProtoField.uint32, "Deadline (us)", base.DEC)
field("plain.t0", ProtoField.int64, "t0 (ns, the sender's clock)", base.DEC)
field("plain.channel", ProtoField.uint16, "Channel", base.DEC)
field("plain.importance", ProtoField.uint8, "Importance", base.DEC)
field("plain.variant", ProtoField.uint8, "Variant", base.DEC, nil, 0x07)
field("plain.newest_only", ProtoField.bool, "Newest only", 8, nil, 0x08)
field("plain.awaits_better", ProtoField.bool, "Awaits a better variant", 8, nil, 0x10)
field("plain.back", ProtoField.uint16, "Messages back to the one before it", base.DEC)
field("plain.wait_us", ProtoField.uint32, "Waits for it for (us)", base.DEC)
field("plain.needs", ProtoField.bytes, "Needs (delay, bandwidth, reliability, security, least security; 1/255)")

field("round.version", ProtoField.uint8, "Version", base.DEC)
field("round.degraded", ProtoField.bool, "Degraded", 8, nil, 0x01)
field("round.class", ProtoField.uint8, "Class", base.DEC, CLASSES)
field("round.pipeline", ProtoField.uint8, "Pipeline", base.DEC)
field("round.stage", ProtoField.uint8, "Stage", base.DEC)
field("round.stages", ProtoField.uint8, "Stages", base.DEC)
field("round.communication", ProtoField.uint16, "Communication stages", base.HEX)
field("round.variant", ProtoField.uint8, "Variant", base.DEC)
field("round.best_planned", ProtoField.uint8, "Best variant planned", base.DEC)
field("round.x", ProtoField.int16, "X (1/1000)", base.DEC)
field("round.need.delay", ProtoField.uint8, "Need of delay (1/255)", base.DEC)
field("round.need.bandwidth", ProtoField.uint8, "Need of bandwidth (1/255)", base.DEC)
field("round.need.reliability", ProtoField.uint8, "Need of reliability (1/255)", base.DEC)
field("round.need.security", ProtoField.uint8, "Need of security (1/255)", base.DEC)
field("round.origin", ProtoField.uint32, "Origin", base.HEX)
field("round.number", ProtoField.uint32, "Round", base.DEC)
field("round.policy", ProtoField.uint32, "Policy (FNV-1a of its name)", base.HEX)
field("round.deadline_us", ProtoField.uint32, "Deadline (us)", base.DEC)
field("round.period_us", ProtoField.uint32, "Period (us)", base.DEC)
field("round.indicator", ProtoField.uint32, "Outcomes of the 16 rounds before", base.HEX)
field("round.t0", ProtoField.int64, "t0 (ns, the origin's clock)", base.DEC)
field("round.alpha", ProtoField.int64, "Offset of the hops so far (ns)", base.DEC)
field("round.guard", ProtoField.uint8, "Guard", base.DEC, GUARDS)
field("round.level_used", ProtoField.uint8, "Level used (255: none)", base.DEC)
field("round.variant_used", ProtoField.uint8, "Variant used (255: none)", base.DEC)
field("round.local_quality", ProtoField.uint8, "Local quality (1/255)", base.DEC)
field("round.miss_price", ProtoField.uint16, "Price of a miss (1/1000)", base.DEC)
field("round.excess", ProtoField.int16, "Lost before the computation (D_N/16384)", base.DEC)
field("round.computed", ProtoField.uint16, "Computed (D_N/16384)", base.DEC)
field("round.e2e", ProtoField.bytes, "End-to-end times of the 16 rounds before")

field("u", ProtoField.int64, "u (ns, the sender's clock)", base.DEC)
field("echo_session", ProtoField.uint32, "Echo", base.HEX, nil, nil, "The receiver's session as the sender has heard it")
field("features", ProtoField.uint16, "Features", base.HEX)
field("reports", ProtoField.uint8, "Reports", base.DEC)
field("completes", ProtoField.uint8, "Complete messages", base.DEC)
field("refuseds", ProtoField.uint8, "Refused messages", base.DEC)
field("complete.message", ProtoField.uint32, "Complete message", base.DEC)
field("complete.ago_us", ProtoField.uint32, "Complete for (us)", base.DEC, nil, 0x3fffffff)
field("complete.dropped", ProtoField.bool, "Dropped there", 32, nil, 0x80000000)
field("complete.kept", ProtoField.bool, "Kept there", 32, nil, 0x40000000)
field("refused.message", ProtoField.uint32, "Refused message", base.DEC)
field("report.link", ProtoField.uint16, "Link", base.DEC)
field("report.has_exchange", ProtoField.bool, "s and h are there", 8, nil, 0x01)
field("report.loss", ProtoField.uint16, "Own loss (1/65535)", base.DEC)
field("report.train_packets", ProtoField.uint32, "Packets of the newest train", base.DEC)
field("report.s", ProtoField.int64, "s (ns, the receiver's clock)", base.DEC)
field("report.h", ProtoField.int64, "h (ns)", base.DEC)
field("report.largest", ProtoField.uint64, "Largest number received", base.DEC)
field("report.bitmap", ProtoField.bytes, "Which of the 256 before arrived")
field("report.missing", ProtoField.uint32, "Missing of the 256 before", base.DEC)
field("report.train_start", ProtoField.uint64, "First packet of the train", base.DEC)
field("report.train_rate", ProtoField.uint32, "Rate of the train (kbit/s)", base.DEC)
field("report.rate", ProtoField.uint32, "Own rate (kbit/s)", base.DEC)
field("report.metered", ProtoField.bool, "Metered", 8, nil, 0x02)
field("report.has_delays", ProtoField.bool, "Delays are there", 8, nil, 0x04)
field("report.newest_delay_us", ProtoField.uint32, "Newest delay (us, modulo 2^32)", base.DEC)
field("report.largest_delay_us", ProtoField.uint32, "Largest delay (us, modulo 2^32)", base.DEC)
field("report.ect0", ProtoField.uint16, "Packets marked ECT(0)", base.DEC)
field("report.ect1", ProtoField.uint32, "Packets marked ECT(1)", base.DEC)
field("report.ce", ProtoField.uint32, "Packets marked CE", base.DEC)
field("report.received_bytes", ProtoField.uint64, "Bytes received", base.DEC)

field("echo.reply", ProtoField.bool, "Reply", 8, nil, 0x01)
field("echo.hold", ProtoField.bool, "Hold", 8, nil, 0x02)
field("echo.delay", ProtoField.uint8, "Delay of the reply (s)", base.DEC)
field("echo.train", ProtoField.uint16, "Train", base.DEC)
field("echo.index", ProtoField.uint16, "Index", base.DEC)
field("echo.count", ProtoField.uint16, "Count", base.DEC)
field("stamp.sequence", ProtoField.uint32, "Sequence", base.DEC)
field("stamp.timestamp", ProtoField.relative_time, "Timestamp (t1 of a request, t3 of a reply)")
field("stamp.error", ProtoField.uint16, "Error estimate", base.HEX)
field("stamp.received", ProtoField.relative_time, "Receive timestamp (t2)")
field("stamp.request_sequence", ProtoField.uint32, "Session-Sender sequence", base.DEC)
field("stamp.request_timestamp", ProtoField.relative_time, "Session-Sender timestamp (t1)")
field("stamp.request_error", ProtoField.uint16, "Session-Sender error estimate", base.HEX)
field("stamp.request_ttl", ProtoField.uint8, "Session-Sender TTL", base.DEC)

local all = {}
for _, one in pairs(f) do all[#all + 1] = one end
interneuron.fields = all

local malformed = ProtoExpert.new("interneuron.malformed", "Malformed: docs/wire_format.md forbids it",
  expert.group.MALFORMED, expert.severity.ERROR)
interneuron.experts = { malformed }

interneuron.prefs.port = Pref.uint("UDP port", 47000, "Packets from or to this port are taken for ours (0: none)")
interneuron.prefs.heuristic = Pref.bool("Other ports too", true, "Take packets on other ports that look like ours")

-- Adds fields of these sizes one after the other from `at` on; nil skips reserved bytes. Returns what is behind.
local function add_all(tree, buffer, at, rows)
  for _, row in ipairs(rows) do
    local name, size = row[1], row[2]
    if name then tree:add(f[name], buffer(at, size)) end
    at = at + size
  end
  return at
end

local function ntp_time(range)
  local seconds = range(0, 4):uint()
  local fraction = range(4, 4):uint()
  return NSTime.new(seconds, math.floor(fraction * 1000000000 / 4294967296 + 0.5) % 1000000000)
end

local function all_zero(range)
  for i = 0, range:len() - 1 do
    if range(i, 1):uint() ~= 0 then return false end
  end
  return true
end

-- A packet in the clear, one of a handshake or a sealed one; nothing: it is none of ours.
local function form_of(buffer)
  local size = buffer:len()
  if size < HEADER_BYTES + TAG_BYTES or size ~= buffer:reported_len() then return nil end
  local first, epoch = buffer(0, 1):uint(), buffer(1, 1):uint()
  local is_plausible = math.floor(first / 16) == VERSION and first % 16 > 0 and buffer(4, 4):uint() ~= 0
    and not all_zero(buffer(8, 8))
  if not is_plausible then return nil end
  if epoch == 1 then return "sealed" end
  if epoch ~= 0 then return nil end
  local is_long = first % 16 == INITIATION and size == HANDSHAKE_BYTES[INITIATION] + CREDENTIAL_BYTES
  if (is_long or size == HANDSHAKE_BYTES[first % 16]) and all_zero(buffer(ASSOCIATED_BYTES, 4)) then return "handshake" end
  return all_zero(buffer(size - TAG_BYTES, TAG_BYTES)) and "clear" or nil
end

-- Of the number of a sealed packet, which has little else that tells it from bytes of others on any port: a sender counts
-- from the microseconds of its life so far, so that the upper two bytes are zero for nine years.
local function is_few(range) return all_zero(range(0, 2)) end

local function add_round_header(tree, buffer)
  local round = tree:add(interneuron, buffer(0, ROUND_HEADER_BYTES), "Round header")
  round:add(f["round.version"], buffer(0, 1))
  round:add(f["round.degraded"], buffer(1, 1))
  add_all(round, buffer, 2, {
    { "round.class", 1 }, { "round.pipeline", 1 }, { "round.stage", 1 }, { "round.stages", 1 },
    { "round.communication", 2 }, { "round.variant", 1 }, { "round.best_planned", 1 }, { "round.x", 2 },
    { "round.need.delay", 1 }, { "round.need.bandwidth", 1 }, { "round.need.reliability", 1 },
    { "round.need.security", 1 }, { "round.origin", 4 }, { "round.number", 4 }, { "round.policy", 4 },
    { "round.deadline_us", 4 }, { "round.period_us", 4 } })
  local outcomes = round:add(f["round.indicator"], buffer(36, 4))
  local bits = buffer(36, 4):uint()
  local number = buffer(20, 4):uint()
  for i = 0, 15 do
    local state = math.floor(bits / 4 ^ i) % 4
    if state ~= 0 then outcomes:add(buffer(36, 4), string.format("Round %d: %s", number - 1 - i, STATES[state])) end
  end
  add_all(round, buffer, 40, { { "round.t0", 8 }, { "round.alpha", 8 }, { "round.guard", 1 },
    { "round.level_used", 1 }, { "round.variant_used", 1 }, { "round.local_quality", 1 },
    { "round.miss_price", 2 }, { "round.excess", 2 }, { "round.computed", 2 } })
  local times = round:add(f["round.e2e"], buffer(66, 32))
  for i = 0, 15 do
    local steps = buffer(66 + 2 * i, 2):uint()
    if steps ~= 0 then
      local text = steps == 65535 and "later or never"
        or string.format("%.2f ms", steps / 16384 * buffer(28, 4):uint() / 1000)
      times:add(buffer(66 + 2 * i, 2), string.format("Round %d: %s", number - 1 - i, text))
    end
  end
  round:append_text(string.format(": round %d, stage %d of %d, %s", number, buffer(4, 1):uint(), buffer(5, 1):uint(),
    CLASSES[buffer(2, 1):uint()] or "?"))
  if buffer(0, 1):uint() ~= 3 then round:add_proto_expert_info(malformed) end
end

-- Returns how many bytes it has; nothing where they are not there.
local function add_plain_header(tree, buffer)
  local flags = buffer(19, 1):uint()
  local has_needs = math.floor(flags / 32) % 2 == 1
  local has_order = math.floor(flags / 64) % 2 == 1
  local needs, order = has_needs and 5 or 0, has_order and 6 or 0
  local size = PLAIN_HEADER_BYTES + needs + order
  if buffer:len() < size then return nil end
  local plain = tree:add(interneuron, buffer(0, size), "Plain header")
  add_all(plain, buffer, 0, { { "plain.id", 4 }, { "plain.deadline_us", 4 }, { "plain.t0", 8 }, { "plain.channel", 2 },
    { "plain.importance", 1 } })
  plain:add(f["plain.variant"], buffer(19, 1))
  plain:add(f["plain.newest_only"], buffer(19, 1))
  plain:add(f["plain.awaits_better"], buffer(19, 1))
  plain:append_text(string.format(": message %d on channel %d", buffer(0, 4):uint(), buffer(16, 2):uint()))
  if has_needs then plain:add(f["plain.needs"], buffer(PLAIN_HEADER_BYTES, 5)) end
  if has_order then add_all(plain, buffer, PLAIN_HEADER_BYTES + needs, { { "plain.back", 2 }, { "plain.wait_us", 4 } }) end
  local awaits_nothing = flags % 32 >= 16 and flags % 8 == 0
  if flags >= 128 or awaits_nothing or buffer(4, 4):uint() == 0 then plain:add_proto_expert_info(malformed) end
  return size
end

local function add_data(tree, buffer)
  if buffer:len() < PIECE_BYTES then return nil end
  add_all(tree, buffer, 0,
    { { "message", 4 }, { "size", 4 }, { "chunk", 2 }, { "index", 2 }, { "lifetime_us", 4 }, { "kind", 1 } })
  local message, total, chunk, index = buffer(0, 4):uint(), buffer(4, 4):uint(), buffer(8, 2):uint(), buffer(10, 2):uint()
  local kind = buffer(16, 1):uint()
  if chunk == 0 or total == 0 or kind > 1 then return nil end
  local count = math.ceil(total / chunk)
  tree:add(f.count, buffer(4, 6), count):set_generated()
  local size = buffer:len() - PIECE_BYTES
  local at = PIECE_BYTES
  if index >= count then
    local blocks = math.ceil(count / MOST_PIECES)
    local block, row = (index - count) % blocks, math.floor((index - count) / blocks)
    if row >= MOST_ROWS or size ~= chunk then tree:add_proto_expert_info(malformed) end
    tree:add(f["repair.block"], block):set_generated()
    tree:add(f["repair.row"], row):set_generated()
    if buffer:len() > at then tree:add(f["repair.symbol"], buffer(at)) end
    return string.format("message %d, repair symbol %d of block %d of %d", message, row + 1, block + 1, blocks)
  end
  if count > 65535 or size ~= math.min(chunk, total - index * chunk) then tree:add_proto_expert_info(malformed) end
  if index == 0 and kind == 0 and size >= ROUND_HEADER_BYTES then
    add_round_header(tree, buffer(at):tvb())
    at = at + ROUND_HEADER_BYTES
  elseif index == 0 and kind == 1 and size >= PLAIN_HEADER_BYTES then
    at = at + (add_plain_header(tree, buffer(at):tvb()) or 0)
  end
  if buffer:len() > at then tree:add(f.payload, buffer(at)) end
  return string.format("message %d, piece %d of %d", message, index + 1, count)
end

local function add_report(tree, buffer)
  local link = buffer(0, 2):uint()
  local report = tree:add(interneuron, buffer(), string.format("Report of link %d", link))
  report:add(f["report.link"], buffer(0, 2))
  report:add(f["report.has_exchange"], buffer(2, 1))
  report:add(f["report.metered"], buffer(2, 1))
  report:add(f["report.has_delays"], buffer(2, 1))
  add_all(report, buffer, 3, {
    { "report.loss", 2 }, { "report.train_packets", 4 }, { "report.s", 8 }, { "report.h", 8 },
    { "report.largest", 8 }, { "report.bitmap", 32 }, { "report.train_start", 8 }, { "report.train_rate", 4 },
    { "report.rate", 4 }, { "report.newest_delay_us", 4 }, { "report.largest_delay_us", 4 }, { "report.ect0", 2 }, { "report.ect1", 4 },
    { "report.ce", 4 }, { "report.received_bytes", 8 } })
  -- Bit b of word w: packet largest - 1 - (64 w + b); packets before the first say nothing.
  local largest = buffer(25, 8):uint64()
  local known = largest > UInt64(256) and 256 or math.max(largest:tonumber() - 1, 0)
  local missing = 0
  for i = 0, known - 1 do
    local byte = buffer(33 + 8 * math.floor(i / 64) + 7 - math.floor(i % 64 / 8), 1):uint()
    if math.floor(byte / 2 ^ (i % 8)) % 2 == 0 then missing = missing + 1 end
  end
  report:add(f["report.missing"], buffer(33, 32), missing):set_generated()
  if buffer(17, 1):uint() >= 0x80 or buffer(2, 1):uint() >= 8 then report:add_proto_expert_info(malformed) end
end

local function add_feedback(tree, buffer)
  if buffer:len() < FEEDBACK_BYTES then return nil end
  add_all(tree, buffer, 0,
    { { "u", 8 }, { "echo_session", 4 }, { "features", 2 }, { "reports", 1 }, { "completes", 1 }, { "refuseds", 1 } })
  local reports, complete, refused = buffer(14, 1):uint(), buffer(15, 1):uint(), buffer(16, 1):uint()
  local fits = buffer:len() == FEEDBACK_BYTES + reports * REPORT_BYTES + complete * 8 + refused * 4
  if reports > 8 or complete > 32 or refused > 16 or not fits then return nil end
  local at = FEEDBACK_BYTES
  for _ = 1, reports do
    add_report(tree, buffer(at, REPORT_BYTES):tvb())
    at = at + REPORT_BYTES
  end
  for _ = 1, complete do
    at = add_all(tree, buffer, at, { { "complete.message", 4 }, { "complete.ago_us", 4 } })
    tree:add(f["complete.dropped"], buffer(at - 4, 4))
    tree:add(f["complete.kept"], buffer(at - 4, 4))
  end
  for _ = 1, refused do at = add_all(tree, buffer, at, { { "refused.message", 4 } }) end
  return string.format("%d reports, %d complete, %d refused", reports, complete, refused)
end

local function add_stamp(tree, buffer, is_reply)
  local stamp = tree:add(interneuron, buffer(0, STAMP_BYTES), is_reply and "STAMP reply" or "STAMP request")
  stamp:add(f["stamp.sequence"], buffer(0, 4))
  stamp:add(f["stamp.timestamp"], buffer(4, 8), ntp_time(buffer(4, 8)))
  stamp:add(f["stamp.error"], buffer(12, 2))
  if not is_reply then return end
  stamp:add(f["stamp.received"], buffer(16, 8), ntp_time(buffer(16, 8)))
  stamp:add(f["stamp.request_sequence"], buffer(24, 4))
  stamp:add(f["stamp.request_timestamp"], buffer(28, 8), ntp_time(buffer(28, 8)))
  stamp:add(f["stamp.request_error"], buffer(36, 2))
  stamp:add(f["stamp.request_ttl"], buffer(40, 1))
end

local function add_echo(tree, buffer)
  local padding = 8 + STAMP_BYTES + TOKEN_BYTES
  if buffer:len() < padding then return nil end
  local is_reply = buffer(0, 1):uint() % 2 == 1
  tree:add(f["echo.reply"], buffer(0, 1))
  tree:add(f["echo.hold"], buffer(0, 1))
  add_all(tree, buffer, 1, { { "echo.delay", 1 }, { "echo.train", 2 }, { "echo.index", 2 }, { "echo.count", 2 } })
  add_stamp(tree, buffer(8, STAMP_BYTES):tvb(), is_reply)
  tree:add(f["token"], buffer(8 + STAMP_BYTES, TOKEN_BYTES))
  if buffer:len() > padding then tree:add(f.padding, buffer(padding)) end
  local train = buffer(2, 2):uint()
  return string.format("%s %d%s", is_reply and "reply to" or "request",
    buffer(is_reply and 32 or 8, 4):uint(), train > 0 and string.format(", train %d", train) or "")
end

local function bits_of(byte)
  local bits = 0
  while byte > 0 do
    bits = bits + byte % 2
    byte = math.floor(byte / 2)
  end
  return bits
end

local function add_window(tree, buffer)
  if buffer:len() < WINDOW_BYTES then return nil end
  tree:add(f["window.row"], buffer(0, 1))
  tree:add(f["window.messages"], buffer(1, 1))
  local row, count = buffer(0, 1):uint(), buffer(1, 1):uint()
  local symbol = WINDOW_BYTES + 2 * (count - 1)
  if row >= MOST_ROWS or count == 0 or count > MOST_MESSAGES or buffer:len() < symbol then return nil end
  local message, sources = buffer(2, 4):uint(), 0
  for i = 0, count - 1 do
    local at = WINDOW_BYTES - 1 + 2 * i
    local ahead = i == 0 and 0 or buffer(at - 1, 1):uint()
    local pieces = buffer(at, 1):uint()
    if (i > 0 and ahead == 0) or pieces == 0 then return nil end
    message = (message + ahead) % 2 ^ 32
    sources = sources + bits_of(pieces)
    local where = i == 0 and buffer(2, 4) or buffer(at - 1, 1)
    tree:add(f["window.message"], where, message)
    tree:add(f["window.pieces"], buffer(at, 1))
  end
  local size = buffer:len() - symbol
  if sources > MOST_SOURCES or size < FEWEST_CODED then return nil end
  tree:add(f["window.symbol"], buffer(symbol))
  return string.format("row %d of %d pieces of %d messages", row, sources, count)
end

local function add_challenge(tree, buffer)
  if buffer:len() ~= 4 + TOKEN_BYTES then return nil end
  tree:add(f["echo_session"], buffer(0, 4))
  tree:add(f["token"], buffer(4))
  return string.format("for session 0x%08x", buffer(0, 4):uint())
end

local function add_token(tree, buffer)
  if buffer:len() ~= TOKEN_BYTES then return nil end
  tree:add(f["token"], buffer())
  return "answers a challenge"
end

local function add_probe(tree, buffer)
  if buffer:len() > 0 then tree:add(f.padding, buffer()) end
  return string.format("%d bytes", buffer:len() + HEADER_BYTES + TAG_BYTES)
end

-- The body of a type that is not used.
local function add_unknown(tree, buffer)
  if buffer:len() > 0 then tree:add(f.body, buffer()) end
  return string.format("%d bytes", buffer:len() + HEADER_BYTES + TAG_BYTES)
end

local BODIES = { [1] = add_data, [2] = add_feedback, [3] = add_probe, [4] = add_echo, [6] = add_window,
  [7] = add_challenge, [8] = add_token }

local function add_clear(tree, buffer, kind)
  local size = buffer:len()
  tree:add(f.stamp_us, buffer(ASSOCIATED_BYTES, 4))
  local body = size - HEADER_BYTES - TAG_BYTES
  local said
  if body > 0 then
    said = (BODIES[kind] or add_unknown)(tree, buffer(HEADER_BYTES, body):tvb())
  elseif kind == 3 or not BODIES[kind] then
    said = string.format("%d bytes", size)
  end
  tree:add(f.tag, buffer(size - TAG_BYTES, TAG_BYTES))
  return said
end

local function add_sealed(tree, buffer)
  local size = buffer:len()
  local sealed = buffer(ASSOCIATED_BYTES, size - ASSOCIATED_BYTES - TAG_BYTES)
  tree:add(f.sealed, sealed)
  tree:add(f.sealed_bytes, sealed, size - HEADER_BYTES - TAG_BYTES):set_generated()
  tree:add(f.tag, buffer(size - TAG_BYTES, TAG_BYTES))
  return string.format("%d bytes", size)
end

local function add_initiation(tree, buffer)
  local at = add_all(tree, buffer, HEADER_BYTES, { { "handshake.ephemeral", 32 }, { "handshake.static", 48 },
    { "handshake.hello", buffer:len() - HANDSHAKE_BYTES[INITIATION] + 41 }, { "handshake.proof", 16 },
    { "handshake.mac1", 16 }, { "handshake.mac2", 16 } })
  local has_cookie = not all_zero(buffer(at - 16, 16))
  tree:add(f["handshake.has_cookie"], buffer(at - 16, 16), has_cookie):set_generated()
  return has_cookie and "with a cookie" or "without a cookie"
end

local function add_response(tree, buffer)
  add_all(tree, buffer, HEADER_BYTES, { { "handshake.ephemeral", 32 }, { "handshake.hello", 41 }, { "token", TOKEN_BYTES },
    { "handshake.proof", 16 } })
  return "with a token"
end

local function add_cookie(tree, buffer)
  add_all(tree, buffer, HEADER_BYTES, { { "handshake.nonce", 24 }, { "handshake.cookie", 32 } })
  return "instead of a response"
end

local HANDSHAKES = { [INITIATION] = add_initiation, [RESPONSE] = add_response, [COOKIE] = add_cookie }

function interneuron.dissector(buffer, pinfo, root)
  local form = form_of(buffer)
  if not form then return 0 end
  local size = buffer:len()
  local kind = buffer(0, 1):uint() % 16
  local name = (form == "sealed" and "sealed " or "") .. (TYPES[kind] or string.format("type %d", kind))
  pinfo.cols.protocol = "INTERNEURON"
  local tree = root:add(interneuron, buffer(), "Interneuron " .. name)
  tree:add(f.version, buffer(0, 1))
  add_all(tree, buffer, 0, { { "type", 1 }, { "epoch", 1 }, { "link", 2 }, { "session", 4 }, { "number", 8 } })
  local said
  if form == "sealed" then
    said = add_sealed(tree, buffer)
  elseif form == "handshake" then
    said = HANDSHAKES[kind](tree, buffer)
  else
    said = add_clear(tree, buffer, kind)
  end
  if not said or size > MOST_BYTES then
    tree:add_proto_expert_info(malformed)
    said = "malformed"
  end
  local text = string.format("%s, link %d, #%s: %s", name, buffer(2, 2):uint(), tostring(buffer(8, 8):uint64()), said)
  pinfo.cols.info = text
  tree:append_text(", " .. text)
  return size
end

local udp = DissectorTable.get("udp.port")
local taken = 0
local function take_port()
  if taken > 0 then udp:remove(taken, interneuron) end
  taken = interneuron.prefs.port
  if taken > 0 then udp:add(taken, interneuron) end
end
function interneuron.prefs_changed() take_port() end
take_port()

interneuron:register_heuristic("udp", function(buffer, pinfo, root)
  local form = interneuron.prefs.heuristic and form_of(buffer)
  if not form or (form == "sealed" and not is_few(buffer(8, 8))) then return false end
  interneuron.dissector(buffer, pinfo, root)
  return true
end)
