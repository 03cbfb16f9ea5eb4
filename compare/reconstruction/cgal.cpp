// Advancing front surface reconstruction of a cloud by CGAL.
// usage: cgal CLOUD.xyz MESH.off          prints the seconds of the reconstruction alone
#include <CGAL/Advancing_front_surface_reconstruction.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <vector>

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Facet = std::array<std::size_t, 3>;

int main(int argc, char** argv) {
    if (argc != 3) {
        std::fprintf(stderr, "usage: cgal CLOUD.xyz MESH.off\n");
        return 2;
    }
    std::ifstream in(argv[1]);
    std::vector<Kernel::Point_3> points;
    for (double x, y, z; in >> x >> y >> z;) {
        points.emplace_back(x, y, z);
    }
    std::vector<Facet> facets;
    const auto start = std::chrono::steady_clock::now();
    CGAL::advancing_front_surface_reconstruction(points.begin(), points.end(), std::back_inserter(facets));
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    std::ofstream out(argv[2]);
    out.precision(17);
    out << "OFF\n" << points.size() << ' ' << facets.size() << " 0\n";
    for (const auto& p : points) {
        out << p.x() << ' ' << p.y() << ' ' << p.z() << '\n';
    }
    for (const auto& f : facets) {
        out << "3 " << f[0] << ' ' << f[1] << ' ' << f[2] << '\n';
    }
    std::printf("%.4f\n", took.count());
}
