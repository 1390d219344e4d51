#[path = "../tests/common/mod.rs"] mod common;
use dimcmc::imaging::*; use dimcmc::maxent::entropy::Entropy; use dimcmc::maxent::*; use dimcmc::star::*; use dimcmc::objective::*;
fn main(){
  let o=common::oracle();
  let grid=SurfaceGrid::equal_area(2000, Quadrature::Gauss2x2);
  let imager=Imager{grid,star:o.star.clone(),sampling:o.sampling.clone(),data:o.data.clone(),entropy:Entropy::new(1e-4)};
  let mut v=common::values(&o.json["results"]["fixed_lambda"][0]["theta"],3.0);
  v[Parameter::K]=0.09; v[Parameter::PorbOverProt]=1.76; v[Parameter::Phi]=0.486;
  let r=Reference::build(&imager,v,0.97).unwrap();
  let mut w=v; w[Parameter::Vsini]-=2.0;
  for w in [w, {let mut w=v; w[Parameter::K]+=0.2; w}] {
  for goal in [Goal::Lambda(r.solution.image.lambda), Goal::Chi2{target:r.chi2_target,largest_lambda:5.0*r.solution.image.lambda}] {
  let mut p=imager.problem(imager.response(&w.state()));
  let solver=Solver{entropy:imager.entropy,preconditioner:&r.preconditioner,settings:SolverSettings::default()};
  let s=solver.solve(&mut p,goal,&r.start());
  println!("{goal:?} {:?} {} {}", s.termination, s.newton_steps, p.passes());
  }}
}
