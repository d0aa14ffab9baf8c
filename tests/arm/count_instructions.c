// Plugin for QEMU's user emulation (plugin API 0..1, qemu-user 7.2): how many instructions a 32-bit
// ARM program executes in regions that it marks itself with prctl(0x54424D, region, 1) and
// prctl(0x54424D, region, 0), region 0..31. At the end one line for each region on stderr:
//   region 1 calls 4 instructions 548705 neon 273189 vfp64 16522 vfp32 3677 load_store 86551
// Means over the calls. neon: NEON data processing and element loads; vfp64, vfp32: arithmetic of the scalar
// unit; load_store: all other memory instructions. Counts of a program with one thread are exact.
//
// Build: gcc -shared -fPIC -O2 count_instructions.c -o count_instructions.so
// No distribution ships qemu-plugin.h with the emulator, so what is used of it is declared here.
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

typedef uint64_t PluginId;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
struct qemu_info;
enum { kAddInline = 0 };

typedef void (*OnTranslation)(PluginId, struct qemu_plugin_tb*);
typedef void (*OnSystemCall)(PluginId, unsigned vcpu, int64_t number, uint64_t, uint64_t, uint64_t, uint64_t,
                             uint64_t, uint64_t, uint64_t, uint64_t);
typedef void (*OnExit)(PluginId, void*);

void qemu_plugin_register_vcpu_tb_trans_cb(PluginId, OnTranslation);
void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb*, int operation, void* counter, uint64_t);
void qemu_plugin_register_vcpu_syscall_cb(PluginId, OnSystemCall);
void qemu_plugin_register_atexit_cb(PluginId, OnExit, void*);
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb*);
struct qemu_plugin_insn* qemu_plugin_tb_get_insn(const struct qemu_plugin_tb*, size_t index);
const void* qemu_plugin_insn_data(const struct qemu_plugin_insn*);
size_t qemu_plugin_insn_size(const struct qemu_plugin_insn*);

__attribute__((visibility("default"))) int qemu_plugin_version = 1;

enum Kind { kAll, kNeon, kDouble, kSingle, kLoadStore, kKinds, kOther = kAll };
static const char* const kNames[kKinds] = {"instructions", "neon", "vfp64", "vfp32", "load_store"};

enum { kRegions = 32, kMarker = 0x54424D, kPrctlOfArm = 172 };
static uint64_t executed[kKinds];
static struct {
  uint64_t began_at[kKinds];
  uint64_t sum[kKinds];
  uint64_t calls;
} regions[kRegions];

// Coprocessors 10 and 11 are the floating-point unit; both encodings have the same lower half.
static bool IsFloatUnit(uint32_t instruction) { return ((instruction >> 9) & 7) == 5; }
static enum Kind ArithmeticOf(uint32_t instruction) { return (instruction >> 8) & 1 ? kDouble : kSingle; }

static enum Kind KindOfShortThumb(uint32_t half) {
  const uint32_t top4 = half >> 12;
  const bool is_literal_load = half >> 11 == 0x09;
  const bool is_transfer = top4 >= 5 && top4 <= 9;
  const bool is_multiple = top4 == 0xC;
  const bool is_push_or_pop = (half & 0xF600) == 0xB400;
  return is_literal_load || is_transfer || is_multiple || is_push_or_pop ? kLoadStore : kOther;
}

// The first half-word stands in the upper half.
static enum Kind KindOfLongThumb(uint32_t word) {
  if ((word & 0xEF000000) == 0xEF000000 || (word & 0xFF100000) == 0xF9000000) return kNeon;
  if ((word & 0xEC000000) == 0xEC000000 && IsFloatUnit(word)) {
    return (word & 0xFF000000) == 0xEE000000 ? ArithmeticOf(word) : kLoadStore;
  }
  const bool is_single = (word & 0xFE000000) == 0xF8000000;
  const bool is_multiple = (word & 0xFE000000) == 0xE8000000;
  return is_single || is_multiple ? kLoadStore : kOther;
}

static enum Kind KindOfArm(uint32_t word) {
  if (word >> 25 == 0x79 || (word & 0xFF100000) == 0xF4000000) return kNeon;
  const uint32_t group = (word >> 24) & 0xF;
  if (group == 0xC || group == 0xD) return IsFloatUnit(word) ? kLoadStore : kOther;
  if (group == 0xE && IsFloatUnit(word)) return ArithmeticOf(word);
  const bool is_single = ((word >> 26) & 3) == 1;
  const bool is_multiple = ((word >> 25) & 7) == 4;
  return is_single || is_multiple ? kLoadStore : kOther;
}

static uint32_t HalfAt(const uint8_t* bytes) { return (uint32_t)(bytes[0] | bytes[1] << 8); }

// Four bytes are one ARM instruction or a long Thumb one; every long Thumb instruction begins with a
// half-word that no short one has, and a block is all in one state.
static bool IsThumb(const struct qemu_plugin_tb* block) {
  for (size_t i = 0; i < qemu_plugin_tb_n_insns(block); ++i) {
    const struct qemu_plugin_insn* instruction = qemu_plugin_tb_get_insn(block, i);
    if (qemu_plugin_insn_size(instruction) == 2) return true;
    if (HalfAt(qemu_plugin_insn_data(instruction)) < 0xE800) return false;
  }
  return true;
}

static void Translate(PluginId id, struct qemu_plugin_tb* block) {
  (void)id;
  const bool is_thumb = IsThumb(block);
  uint64_t count[kKinds] = {0};
  count[kAll] = qemu_plugin_tb_n_insns(block);
  for (size_t i = 0; i < count[kAll]; ++i) {
    const struct qemu_plugin_insn* instruction = qemu_plugin_tb_get_insn(block, i);
    const uint8_t* bytes = qemu_plugin_insn_data(instruction);
    enum Kind kind = kOther;
    if (qemu_plugin_insn_size(instruction) == 2) {
      kind = KindOfShortThumb(HalfAt(bytes));
    } else if (is_thumb) {
      kind = KindOfLongThumb(HalfAt(bytes) << 16 | HalfAt(bytes + 2));
    } else {
      kind = KindOfArm(HalfAt(bytes) | HalfAt(bytes + 2) << 16);
    }
    if (kind != kOther) ++count[kind];
  }
  for (int kind = 0; kind < kKinds; ++kind) {
    if (count[kind] == 0) continue;
    qemu_plugin_register_vcpu_tb_exec_inline(block, kAddInline, &executed[kind], count[kind]);
  }
}

static void Mark(PluginId id, unsigned vcpu, int64_t number, uint64_t option, uint64_t region, uint64_t begins,
                 uint64_t a4, uint64_t a5, uint64_t a6, uint64_t a7, uint64_t a8) {
  (void)id, (void)vcpu, (void)a4, (void)a5, (void)a6, (void)a7, (void)a8;
  if (number != kPrctlOfArm || option != kMarker || region >= kRegions) return;
  for (int kind = 0; kind < kKinds; ++kind) {
    if (begins == 1) {
      regions[region].began_at[kind] = executed[kind];
    } else {
      regions[region].sum[kind] += executed[kind] - regions[region].began_at[kind];
    }
  }
  if (begins != 1) ++regions[region].calls;
}

static void Report(PluginId id, void* unused) {
  (void)id, (void)unused;
  for (int region = 0; region < kRegions; ++region) {
    const double calls = (double)regions[region].calls;
    if (calls == 0) continue;
    fprintf(stderr, "region %d calls %.0f", region, calls);
    for (int kind = 0; kind < kKinds; ++kind) {
      fprintf(stderr, " %s %.0f", kNames[kind], (double)regions[region].sum[kind] / calls);
    }
    fprintf(stderr, "\n");
  }
}

__attribute__((visibility("default"))) int qemu_plugin_install(PluginId id, const struct qemu_info* info, int count,
                                                               char** arguments) {
  (void)info, (void)count, (void)arguments;
  qemu_plugin_register_vcpu_tb_trans_cb(id, Translate);
  qemu_plugin_register_vcpu_syscall_cb(id, Mark);
  qemu_plugin_register_atexit_cb(id, Report, NULL);
  return 0;
}
