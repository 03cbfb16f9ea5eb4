// Times CGAL on the same files: cgal FILE THREADS REPEATS prints "seconds cpu_seconds finite_cells" a run.
// EPICK, spatial sort inside the range constructor; THREADS 0 is the sequential structure, more the TBB one.
#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Delaunay_triangulation_cell_base_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_vertex_base_3.h>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <tbb/global_control.h>
#include <vector>

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
template <class Tag>
using Structure =
    CGAL::Triangulation_data_structure_3<CGAL::Triangulation_vertex_base_3<Kernel>,
                                         CGAL::Delaunay_triangulation_cell_base_3<Kernel>, Tag>;
using Sequential = CGAL::Delaunay_triangulation_3<Kernel, Structure<CGAL::Sequential_tag>>;
using Parallel = CGAL::Delaunay_triangulation_3<Kernel, Structure<CGAL::Parallel_tag>>;

int main(int argc, char **argv) {
  if (argc < 4) return 2;
  std::vector<Point> points;
  std::FILE *file = std::fopen(argv[1], "rb");
  if (!file) return 2;
  for (double p[3]; std::fread(p, 8, 3, file) == 3;) points.emplace_back(p[0], p[1], p[2]);
  std::fclose(file);
  const int threads = std::atoi(argv[2]);
  for (int run = 0; run < std::atoi(argv[3]); ++run) {
    const std::clock_t cpu = std::clock();
    const auto start = std::chrono::steady_clock::now();
    std::size_t cells;
    auto report = [&] {
      const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
      std::printf("%.4f %.4f ", seconds.count(), double(std::clock() - cpu) / CLOCKS_PER_SEC);
    };
    if (threads == 0) {
      Sequential t(points.begin(), points.end());
      report();
      cells = t.number_of_finite_cells();
    } else {
      tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      const CGAL::Bbox_3 box = CGAL::bbox_3(points.begin(), points.end());
      Parallel::Lock_data_structure locks(box, 50);
      Parallel t(points.begin(), points.end(), &locks);
      report();
      cells = t.number_of_finite_cells();
    }
    std::printf("%zu\n", cells);
    std::fflush(stdout);
  }
}
