// The vector operations of this machine against the same written out plainly, bit for bit.
#include "pose/centres/vectors.h"

#include <bit>
#include <cstring>
#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace tbm::test {
namespace {

using testing::ElementsAreArray;

// Every size and sign but none that NEON takes for zero, nor 0 and -0 against each other; whole
// numbers, powers of two, neighbours of one another.
float AnyFloat(Random& random) {
  switch (random.Index(6)) {
    case 0:
      return static_cast<float>(random.Normal());
    case 1:
      return static_cast<float>(random.Index(512) - 256);
    case 2:
      return std::ldexp(1.0f, random.Index(80) - 40);
    case 3:
      return std::nextafter(static_cast<float>(1 + random.Index(9)), 100.0f);
    case 4:
      return -static_cast<float>(std::exp(random.Uniform(-30.0, 30.0)));
    default:
      return static_cast<float>(std::exp(random.Uniform(-30.0, 30.0)));
  }
}

struct Four {
  float lane[4];
  std::vector<std::uint32_t> Bits() const {
    std::vector<std::uint32_t> bits;
    for (const float value : lane) bits.push_back(std::bit_cast<std::uint32_t>(value));
    return bits;
  }
};

Four AnyFour(Random& random) {
  Four four;
  for (float& lane : four.lane) lane = AnyFloat(random);
  return four;
}

Four Positive(Four four) {
  for (float& lane : four.lane) lane = std::abs(lane) + 1e-12f;
  return four;
}

// Applies one operation with the vectors of both kinds and compares.
#define TBM_EXPECT_SAME(expression)                                                  \
  do {                                                                               \
    Four by_native;                                                                  \
    Four by_plain;                                                                   \
    {                                                                                \
      using namespace native;                                                        \
      const auto a = Load(first.lane), b = Load(second.lane), c = Load(third.lane);  \
      (void)a, (void)b, (void)c;                                                     \
      Store(by_native.lane, expression);                                             \
    }                                                                                \
    {                                                                                \
      using namespace plain;                                                         \
      const auto a = Load(first.lane), b = Load(second.lane), c = Load(third.lane);  \
      (void)a, (void)b, (void)c;                                                     \
      Store(by_plain.lane, expression);                                              \
    }                                                                                \
    EXPECT_THAT(by_native.Bits(), ElementsAreArray(by_plain.Bits())) << #expression; \
  } while (false)

TEST(Vectors, FloatsAreThoseOfThePlainOnes) {
  Random random("Vectors.Floats");
  for (int draw = 0; draw < 3000; ++draw) {
    const Four first = AnyFour(random);
    const Four second = AnyFour(random);
    const Four third = AnyFour(random);
    TBM_EXPECT_SAME(a + b);
    TBM_EXPECT_SAME(a - b);
    TBM_EXPECT_SAME(a * b);
    TBM_EXPECT_SAME(MulAdd(a, b, c));
    TBM_EXPECT_SAME(MulSub(a, b, c));
    TBM_EXPECT_SAME(Smaller(a, b));
    TBM_EXPECT_SAME(Larger(a, b));
    TBM_EXPECT_SAME(Absolute(a));
    TBM_EXPECT_SAME(LeftNeighbours(a, b));
    TBM_EXPECT_SAME(Where(IsLess(a, b), c));
    TBM_EXPECT_SAME(Where(IsLess(a, b) & IsLess(b, c), c));
    TBM_EXPECT_SAME(Where(IsLess(a, b) | IsLess(b, c), c));
    TBM_EXPECT_SAME(Spread(Sum(a)));
    TBM_EXPECT_SAME(Spread(Any(IsLess(Absolute(a), Absolute(b))) ? 1.0f : 0.0f));
  }
}

// A sum, a product that is not exact: rounded twice, not once.
TEST(Vectors, ProductIsRoundedBeforeItIsAdded) {
  const Four first = {{-1.0f, -1.0f, 1.0f, 1.0f}};
  const float above_one = std::nextafter(1.0f, 2.0f);
  const Four second = {{above_one, above_one, above_one, above_one}};
  const Four third = second;
  TBM_EXPECT_SAME(MulAdd(a, b, c));
  TBM_EXPECT_SAME(MulSub(a, b, c));
  Four sum;
  native::Store(sum.lane,
                native::MulAdd(
                    native::Load(first.lane), native::Load(second.lane), native::Load(third.lane)));
  EXPECT_EQ(sum.lane[0], 2.0f * std::numeric_limits<float>::epsilon());
}

TEST(Vectors, WholeHalvedAndReciprocalAreThoseOfThePlainOnes) {
  Random random("Vectors.Whole");
  for (int draw = 0; draw < 3000; ++draw) {
    Four first;
    Four second;
    for (float& lane : first.lane) lane = static_cast<float>(random.Uniform(-1e6, 1e6));
    for (float& lane : second.lane) lane = static_cast<float>(random.Index(30));
    const Four third = Positive(AnyFour(random));
    TBM_EXPECT_SAME(Whole(a));
    TBM_EXPECT_SAME(Halved(a, b));
    TBM_EXPECT_SAME(RoughReciprocal(c));
    Four reciprocal;
    native::Store(reciprocal.lane, native::RoughReciprocal(native::Load(third.lane)));
    for (int lane = 0; lane < 4; ++lane) {
      EXPECT_NEAR(reciprocal.lane[lane] * third.lane[lane], 1.0f, 0.13f);
    }
  }
}

template <class Pixel>
std::vector<Pixel> Lanes(const plain::Pixels<Pixel>& pixels) {
  return {std::begin(pixels.lane), std::end(pixels.lane)};
}

#if defined(__SSE2__) || defined(__ARM_NEON)
template <class Pixel>
std::vector<Pixel> Lanes(const native::Pixels<Pixel>& pixels) {
  std::vector<Pixel> lanes(16 / sizeof(Pixel));
  native::StorePixels(reinterpret_cast<std::byte*>(lanes.data()), pixels);
  return lanes;
}
#endif

// Memory of any alignment and stride; few bits make equal neighbours.
template <class Pixel>
void ComparePixels(Random& random) {
  std::vector<std::byte> memory(9 * 64 * sizeof(Pixel) + 100);
  for (int draw = 0; draw < 600; ++draw) {
    const int bits = random.Index(8 * int{sizeof(Pixel)}) + 1;
    const auto mask = static_cast<std::uint64_t>((1 << bits) - 1);
    for (std::size_t i = 0; i + sizeof(Pixel) <= memory.size(); i += sizeof(Pixel)) {
      auto pixel = static_cast<Pixel>(random.Bits() & mask);
      if (random.Index(9) == 0) pixel = std::numeric_limits<Pixel>::max();
      std::memcpy(&memory[i], &pixel, sizeof pixel);
    }
    const std::byte* first = memory.data() + random.Index(16);
    const std::byte* second = first + 64 + random.Index(16);
    const std::ptrdiff_t stride = 64 * int{sizeof(Pixel)} + random.Index(4);
    const auto threshold = static_cast<Pixel>(random.Bits() & mask);

    const auto a = native::LoadPixels<Pixel>(first);
    const auto b = native::LoadPixels<Pixel>(second);
    const auto plain_a = plain::LoadPixels<Pixel>(first);
    const auto plain_b = plain::LoadPixels<Pixel>(second);
    EXPECT_EQ(Lanes(native::Brighter(a, b)), Lanes(plain::Brighter(plain_a, plain_b)));
    EXPECT_EQ(Lanes(native::Darker(a, b)), Lanes(plain::Darker(plain_a, plain_b)));
    EXPECT_EQ(Lanes(native::Above(a, b)), Lanes(plain::Above(plain_a, plain_b)));
    EXPECT_EQ(Lanes<Pixel>(native::SpreadPixel(threshold)),
              Lanes<Pixel>(plain::SpreadPixel(threshold)));
    EXPECT_EQ(native::SumOfLanes(a), plain::SumOfLanes(plain_a));
    EXPECT_EQ(native::AnyLane(native::Above(a, b)), plain::AnyLane(plain::Above(plain_a, plain_b)));
    EXPECT_FALSE(native::AnyLane(native::Above(a, a)));
    EXPECT_EQ(native::BitsAbove(first, threshold), plain::BitsAbove(first, threshold));

    // Which lane of the sixteen bytes holds a block's brightest is nobody's business.
    const auto brightest = [](const auto& pixels) {
      const std::vector<Pixel> lanes = Lanes<Pixel>(pixels);
      return *std::max_element(lanes.begin(), lanes.end());
    };
    const auto pair = native::BrightestOfBlocks<Pixel>(first, stride);
    const auto plain_pair = plain::BrightestOfBlocks<Pixel>(first, stride);
    EXPECT_EQ(brightest(pair.left), brightest(plain_pair.left));
    EXPECT_EQ(brightest(pair.right), brightest(plain_pair.right));
    EXPECT_EQ(brightest(native::BrightestOfBlock<Pixel>(first, stride)),
              brightest(plain_pair.left));

    std::vector<float> widened(16);
    std::vector<float> plainly_widened(16);
    native::Widen<Pixel>(first, widened.data());
    plain::Widen<Pixel>(first, plainly_widened.data());
    EXPECT_EQ(widened, plainly_widened);
  }
}

TEST(Vectors, BytesAreThoseOfThePlainOnes) {
  Random random("Vectors.Bytes");
  ComparePixels<std::uint8_t>(random);
}

TEST(Vectors, WordsAreThoseOfThePlainOnes) {
  Random random("Vectors.Words");
  ComparePixels<std::uint16_t>(random);
}

}  // namespace
}  // namespace tbm::test
